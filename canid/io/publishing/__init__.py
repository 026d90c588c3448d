"""What the estimators and the recorder say, as JSON datagrams over UDP, for PlotJuggler and dashboards."""
