"""Communication with ROS 2 without an installation of ROS: message types, serialisation, and topics over DDS."""
