"""Pictures by Mitsuba, and what is measured on them."""
