"""Courses: a ball to deliver, a track to drive, a cargo to fetch."""
