"""What is shipped beside the code: the machines around it, and the list of what the image holds."""
