"""Motions in contact whose outcome is known in closed form, and what pliant makes of them and of their derivatives."""
