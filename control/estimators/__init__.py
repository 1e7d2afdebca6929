"""Interchangeable estimators: from poses and applied inputs to motion and disturbance. One file each."""
