"""Pictures that Matplotlib draws of calibrations, responses, touches and replays."""
