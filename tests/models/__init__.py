"""The Promela models, checked by SPIN, and runs of the controllers as steps of them."""
