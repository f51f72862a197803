"""Adaptive model learning (5.5): models that learn from one verified page at once, and from rounds of all.

A verified page first takes the factors of the attributes a step further, then joins the sums that a model carries
(`statistics_update`). The model's learner corrects what is still wrong: "passive-aggressive" moves weights and tables
until the true labelling costs less than any other by a margin, "counting" does nothing, "error-correction" is the
dissertation's update in place of both. A wrong or narrow decision between classes moves their bias and calibration
(`class_decisions`), no costs of zones.
"""
