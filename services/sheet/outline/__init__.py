"""The sheet's boundary in a photo: a closed curve of four sides and four corners."""
