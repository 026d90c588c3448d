"""Beside the estimators: does the model that was learnt over the last minutes still fit, and since when not.

What it cannot see is part of it: an effect that was there from the start is learnt with the rest (but a range rate
that contradicts the gap), a slow drift is followed, and a radar that lags by 0.3 s as a whole gives gap and range rate
that fit each other and a lead that is as plausible as any.
"""
