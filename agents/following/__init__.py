"""Following leaders: their plans, requests that change them, what happens when they are lost."""
