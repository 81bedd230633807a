from .report_file import report_on as report_on
from .report_file import write_report as write_report
