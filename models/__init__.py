"""What is remembered: layout graph models and feedback."""
