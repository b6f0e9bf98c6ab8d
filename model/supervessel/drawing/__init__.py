"""An assembly as a picture: geometry of its vessels, figures, and their pixels."""
