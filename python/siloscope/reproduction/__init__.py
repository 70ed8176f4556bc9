"""The paper's scenarios, measures, tables and figures."""
