"""scaraspec: certifies, records and gates UISR4200S robot traffic."""
