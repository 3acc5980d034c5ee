"""ROS 2 without ROS: its types, their serialisation, and topics over DDS."""
