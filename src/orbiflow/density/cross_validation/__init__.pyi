from .operations import cross_validate as cross_validate
