from .estimators import CrossValidatedRows as CrossValidatedRows
from .estimators import cross_validate as cross_validate
