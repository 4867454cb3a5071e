"""Controllers to copy: plain rclpy, each in one file that imports nothing of this package."""
