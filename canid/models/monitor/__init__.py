"""Change detection alongside the estimators: does the model that was learnt over the last minutes still fit?

It cannot see an effect that was present from the start (it is learnt with the rest, except a range rate that
contradicts the gap), a slow drift (it is followed), or a radar that lags by 0.3 s as a whole (its gap and range rate
fit each other, and its lead is plausible).
"""
