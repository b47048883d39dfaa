"""MCAP files and rosbag2 directories in and out, and the offline pipeline over them."""
