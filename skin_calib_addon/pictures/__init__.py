"""Pictures without Blender: calibrations, responses, touches and replayed recordings."""
