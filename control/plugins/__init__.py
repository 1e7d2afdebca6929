"""Finding, configuring and building named parts: what the registries of controllers and estimators share."""
