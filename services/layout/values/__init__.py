"""Values in the texts of fields: dates, amounts, numbers, and how to reach people."""
