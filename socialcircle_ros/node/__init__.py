"""The only rclpy code: lifecycle node, parameters, worker, health."""
