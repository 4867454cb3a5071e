"""ROS 2 nodes around `bilayer_core`: topics, services, parameters, clock. No formula lives here."""
