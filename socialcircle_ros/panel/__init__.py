"""The tuning page: what it shows and how it asks; no rclpy, which lives behind the `Link` in node/remote.py."""
