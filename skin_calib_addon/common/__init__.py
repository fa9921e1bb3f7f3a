"""Provide what every other package uses: arrays, errors, files, JSON, schema checks."""
