"""Apply loading histories: loads and motions in stages."""
