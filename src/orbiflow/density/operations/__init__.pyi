from .drawing import ColumnSettings as ColumnSettings
