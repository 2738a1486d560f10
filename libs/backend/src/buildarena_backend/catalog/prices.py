"""Prices of model requests: the registry's if it has one, otherwise those of genai-prices."""

from __future__ import annotations

from decimal import Decimal

from buildarena_backend.catalog.models import ModelEntry, Price

PER_MILLION = Decimal(1_000_000)
CENT_FRACTION = Decimal("0.000001")


def price_usd(
    entry: ModelEntry, input_tokens: int, output_tokens: int, cached_tokens: int = 0
) -> Decimal:
    """Return the price of a request, US dollars; zero when no price is known.

    Args:
        input_tokens: Tokens sent, cached ones included.
        output_tokens: Tokens received.
        cached_tokens: The part of the input read from the provider's cache.
    """
    own = entry.price
    if own is not None:
        cached_price = own.input if own.cached is None else own.cached
        total = (
            Decimal(str(own.input)) * (input_tokens - cached_tokens)
            + Decimal(str(cached_price)) * cached_tokens
            + Decimal(str(own.output)) * output_tokens
        )
        return (total / PER_MILLION).quantize(CENT_FRACTION)
    from genai_prices import Usage, calc_price

    usage = Usage(
        input_tokens=input_tokens, output_tokens=output_tokens, cache_read_tokens=cached_tokens
    )
    try:
        price = calc_price(usage, entry.model, provider_id=entry.provider)
    except LookupError:
        return Decimal()
    return Decimal(price.total_price).quantize(CENT_FRACTION)


def listed_price(entry: ModelEntry) -> Price | None:
    """Return the model's price, the file's own or the published one; None if none is known."""
    if entry.price is not None:
        return entry.price
    million = int(PER_MILLION)
    sent, received = price_usd(entry, million, 0), price_usd(entry, 0, million)
    cached = price_usd(entry, million, 0, million)
    if not sent and not received:
        return None
    return Price(
        input=float(sent), output=float(received), cached=float(cached), source="genai-prices"
    )
