"""Following leaders: their plans as they arrive, changes of leaders, and what happens when one is lost."""
