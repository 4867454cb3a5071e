"""Scenes with random mutations, and what becomes of them."""
