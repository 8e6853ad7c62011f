"""To be imported by processes of tests: their searches are small."""

from small_searches import small_searches

kept = small_searches()
kept.__enter__()
