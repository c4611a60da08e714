"""The manufacturing cell of Panescu and Miron (2006): robots with working areas hand parts over to each other."""
