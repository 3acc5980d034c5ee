"""What can be estimated of a robot's own kinematics: a file and a line for each kind of parameters."""
