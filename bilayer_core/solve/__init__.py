"""The Newton matrix: from second derivatives to a band with a border, and its factors."""
