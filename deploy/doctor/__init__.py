"""What `rcopterx doctor` looks at: permissions, certificates, and what a running fleet refuses."""
