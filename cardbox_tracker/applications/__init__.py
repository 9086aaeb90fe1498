"""What is made of the results: scores, robots, files, pictures; nothing below imports it."""
