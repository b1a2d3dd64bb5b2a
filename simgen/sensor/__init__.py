"""What a sensor makes of light: exposure, losses, false counts, frames."""
