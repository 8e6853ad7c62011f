"""The four identification spaces: charts, measures and units."""
