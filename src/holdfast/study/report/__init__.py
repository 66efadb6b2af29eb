"""What a reader gets: tables, figures, the page and the folder."""
