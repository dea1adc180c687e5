"""The view: a page that shows robots live."""
