"""The service: frames from cameras become readings, alerts and forecasts, for years (extra ``[monitor]``)."""
