"""What people look at: pages, tables and pictures of measurements."""
