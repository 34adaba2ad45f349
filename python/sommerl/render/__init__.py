"""Renders pictures with Mitsuba, and measures differences between them. The only room that imports Mitsuba."""
