"""A run as one page: HTML with everything in it, that opens from disk and fetches nothing."""
