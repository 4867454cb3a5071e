"""From a scene file to a validated, frozen configuration in SI units."""
