"""One web page that shows materials, what serves it, and what puts it into notebooks."""
