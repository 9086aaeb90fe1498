"""What writes documents and images of this repository; not installed."""
