"""Studio: a page in the browser that shows an open flight and lets it be played, tuned and measured."""
