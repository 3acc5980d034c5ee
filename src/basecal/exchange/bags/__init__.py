"""Reading of ROS bags: content, choice of sources, and robot states at the times of images."""
