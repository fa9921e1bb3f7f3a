"""Readings of the electronics in; frames of a skin out to ROS 2, MCAP files or UDP, at the rate of the readings."""
