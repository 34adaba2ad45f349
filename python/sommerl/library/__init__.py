"""Libraries: materials by the thousand in one folder, built in parallel, checked, and found."""
