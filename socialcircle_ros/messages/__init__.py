"""ROS messages to arrays and back, as CDR bytes; no rclpy."""
