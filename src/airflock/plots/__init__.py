"""Layer above recordings: figures and video, without pyplot, so that threads and notebooks may draw side by side."""
