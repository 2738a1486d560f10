/** An interval with its value, drawn on a scale; the figures are next to it in words. */
export function Interval({
  low,
  high,
  value,
  from,
  to,
  width = 120,
  label,
}: {
  low: number | null;
  high: number | null;
  value: number | null;
  from: number;
  to: number;
  width?: number;
  label: string;
}) {
  const x = (at: number): number => 5 + ((width - 10) * (at - from)) / Math.max(to - from, 1e-9);
  return (
    <svg width={width} height={16} role="img" aria-label={label} style={{ display: "block" }}>
      <line x1={x(from)} x2={x(to)} y1={8} y2={8} stroke="currentColor" strokeOpacity={0.18} strokeWidth={2} />
      {low !== null && high !== null && (
        <line
          x1={x(low) - (low === high ? 3 : 0)}
          x2={x(high) + (low === high ? 3 : 0)}
          y1={8}
          y2={8}
          stroke="var(--mantine-primary-color-filled)"
          strokeWidth={6}
          strokeLinecap="round"
          strokeOpacity={0.55}
        />
      )}
      {value !== null && <circle cx={x(value)} cy={8} r={4} fill="var(--mantine-color-text)" />}
    </svg>
  );
}
