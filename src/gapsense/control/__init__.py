"""Controllers: what closes the loop from the estimators back to the drive voltage."""
