// Decide which readings are those of a skin without contact, and learn from them. See runtime/rest.py and tare.py,
// which explain the limits.
#pragma once

#include <cstdio>

#include "clock.hpp"
#include "geometry.hpp"
#include "learning.hpp"

namespace skin_calib {

// What a skin learned at rest.
struct Tare {
    std::size_t frames = 0;
    Numbers forces;                    // (n,) that count as offsets from now on, by the response [N]
    bool has_noise = false;            // otherwise too few frames, or readings that never change
    std::vector<std::string> warnings; // why the readings may not be those without contact, or not of the response
};

// The type of readings: whether it is one of whole numbers, and the largest of them.
struct Kind {
    bool is_whole = false;
    double largest = infinity;

    template <class Number> static Kind of() {
        if (!std::numeric_limits<Number>::is_integer) return {};
        return {true, static_cast<double>(std::numeric_limits<Number>::max())};
    }
};

namespace rest {

inline constexpr double max_reading = 1e100, period = 0.0035; // [s] shortest one of the frames that are stored
inline constexpr std::size_t max_frames = 250;

// What readings at rest say.
struct Learned {
    Numbers mean, sigma; // (n,) NaN where there is no reading; standard deviation
    std::optional<Noise> noise;
};

// Return a number with some significant digits.
inline std::string digits(double x, int count) {
    char text[40];
    std::snprintf(text, sizeof text, "%.*g", count, x);
    return text;
}

inline std::string counted(std::size_t number, const std::string& noun) {
    return std::to_string(number) + " " + noun + (number == 1 ? "" : "s");
}

// Return the force of a contact on each taxel (n,) during readings for a tare, 0 without one [N].
inline Numbers contacts_during(Frames rows, const TaxelResponses& responses, bool is_whole) {
    using namespace statistics;
    constexpr std::size_t min_frames = 8, tap = 5;
    constexpr double max_range = 18, max_correlation = 0.98, min_roughness = 0.65, max_common_range = 3.0;
    Numbers forces(rows.n, 0.0);
    if (rows.count < min_frames) return forces;
    Numbers change(rows.n, 0.0), bend(rows.n, 0.0), times(rows.n, 0.0), spans(rows.n), rough,
        sums(rows.count - tap + 1);
    const auto frames = static_cast<double>(rows.count);
    for (std::size_t i = 0; i < rows.n; ++i) {
        double sum = 0, count = 0;
        for (std::size_t f = 0; f < rows.count; ++f)
            if (std::isfinite(rows.at(f, i))) sum += rows.at(f, i), ++count;
        for (std::size_t f = 0; f < rows.count; ++f)
            if (!std::isfinite(rows.at(f, i))) rows.at(f, i) = sum / std::max(count, 1.0);
        for (std::size_t f = 1; f < rows.count; ++f) {
            const double step = rows.at(f, i) - rows.at(f - 1, i);
            change[i] += std::abs(step) / (frames - 1), times[i] += step != 0;
            if (f > 1) bend[i] += std::abs(step - (rows.at(f - 1, i) - rows.at(f - 2, i))) / (frames - 2);
        }
        if (change[i] > 0) rough.push_back(square(bend[i] / change[i]));
        double low = infinity, high = -infinity;
        for (std::size_t f = 0; f + tap <= rows.count; ++f) {
            std::array<double, tap> five{};
            for (std::size_t k = 0; k < tap; ++k) five[k] = rows.at(f + k, i);
            std::sort(five.begin(), five.end());
            low = std::min(low, five[tap / 2]), high = std::max(high, five[tap / 2]), sums[f] += five[tap / 2];
        }
        spans[i] = high - low;
    }
    const double often = median(times), usual = median(change);
    const double rarely = often >= static_cast<double>(min_frames) ? (frames - 1) / often : 1.0;
    const double roughness = rough.empty() ? 1.0 : median(rough) / 3;
    const double correlation = std::min(std::max(3 * (1 - roughness), 0.0), max_correlation);
    const double floor = step_of(rows.values, is_whole).value_or(0.0) / std::sqrt(12.0);
    const double range = *std::max_element(sums.begin(), sums.end()) - *std::min_element(sums.begin(), sums.end());
    const bool is_common = roughness < min_roughness && range > max_common_range * norm_of(spans);
    for (std::size_t i = 0; i < rows.n; ++i) {
        const double sigma =
            std::sqrt(3.141592653589793) / 2 * std::max(change[i], usual) * rarely / std::sqrt(1 - correlation);
        if (spans[i] > max_range * std::max(sigma, floor) || (is_common && change[i] > 0))
            forces[i] = responses.force(i, responses.rest[i] + responses.sign[i] * spans[i]);
    }
    return forces;
}

// Return whether readings are those of a skin at rest, as far as their changes can show it.
inline bool is_rest(const Frames& rows, bool is_whole) {
    using namespace statistics;
    constexpr double max_shift = 4.0, max_peak = 6.0, min_change = 0.25, min_spread = 1e-12;
    for (double x : rows.values)
        if (!(std::abs(x) < max_reading)) return false;
    const double floor = is_whole ? 1.0 : min_spread;
    const Numbers means = means_of(rows), variances = variances_of(rows, means, 1);
    const auto frames = static_cast<double>(rows.count);
    Numbers changes, spread, sigmas, peaks;
    for (std::size_t i = 0; i < rows.n; ++i) {
        double squares = 0, largest = 0;
        Numbers column;
        for (std::size_t f = 0; f < rows.count; ++f) {
            column.push_back(rows.at(f, i));
            if (f == 0) continue;
            const double step = column[f] - column[f - 1];
            squares += step * step, largest = std::max(largest, std::abs(step));
        }
        changes.push_back(squares / (frames - 1) / (2 * std::max(variances[i], min_spread)));
        spread.push_back(std::max(std::max(std::sqrt(variances[i]), largest / 4), min_spread));
        const double low = quantile(column, 0.16), middle = quantile(column, 0.5), high = quantile(column, 0.84);
        sigmas.push_back(std::max(std::max(high - middle, middle - low), floor));
        peaks.push_back(0.0);
        for (double x : column) peaks[i] = std::max(peaks[i], std::abs(x - middle));
    }
    const double change = std::min(median(changes) * (1 + 2 / std::sqrt(frames)), 1.0), usual = median(sigmas);
    const std::size_t half = rows.count / 2;
    const double of_mean = std::sqrt((2 - change) / std::max(change, min_change) / static_cast<double>(half));
    const double limit = max_shift * std::sqrt(2.0) * of_mean;
    double total = 0;
    for (std::size_t i = 0; i < rows.n; ++i) {
        const bool is_noise =
            variances[i] <= floor * floor || (changes[i] >= min_change * change && changes[i] >= min_change);
        double first = 0, second = 0;
        for (std::size_t f = 0; f < rows.count; ++f) (f < half ? first : second) += rows.at(f, i);
        const double shift =
            (second / static_cast<double>(rows.count - half) - first / static_cast<double>(half)) / spread[i];
        total += shift;
        if (!is_noise || !(peaks[i] <= max_peak * std::max(sigmas[i], usual)) || !(std::abs(shift) <= limit))
            return false;
    }
    return std::abs(total / std::sqrt(static_cast<double>(rows.n))) <= limit;
}

// Return what readings at rest say; NaN where a taxel has none.
inline Learned examined(Frames rows, const SkinGeometry& skin, const TaxelResponses& responses, bool is_whole) {
    Learned result;
    for (double& x : rows.values)
        if (!(std::abs(x) < max_reading)) x = not_a_number;
    result.noise = learned(rows, responses, skin.calibration.pairs, is_whole);
    for (std::size_t i = 0; i < rows.n; ++i) {
        double sum = 0, squares = 0, count = 0;
        for (std::size_t f = 0; f < rows.count; ++f)
            if (!std::isnan(rows.at(f, i))) sum += rows.at(f, i), ++count;
        double mean = sum / std::max(count, 1.0);
        for (std::size_t f = 0; f < rows.count; ++f)
            if (!std::isnan(rows.at(f, i))) squares += statistics::square(rows.at(f, i) - mean);
        if (result.noise && !result.noise->dead[i]) mean = result.noise->mean[i] * responses.sign[i];
        result.mean.push_back(count > 0 ? mean : not_a_number);
        result.sigma.push_back(result.noise ? result.noise->sigma[i] : std::sqrt(squares / std::max(count - 1, 1.0)));
    }
    return result;
}

// Add why readings may not be in the unit of their response.
inline void warn_of_unit(const Numbers& values, const Kind& kind, const TaxelResponses& responses,
                         std::vector<std::string>& warnings) {
    constexpr double min_counts = 200.0;
    constexpr std::int64_t min_alignment = 4;
    Numbers ends;
    for (std::size_t i = 0; i < responses.rest.size(); ++i)
        if (std::isfinite(responses.full[i])) ends.insert(ends.end(), {responses.rest[i], responses.full[i]});
    const double last = ends.empty() ? -infinity : *std::max_element(ends.begin(), ends.end());
    if (last > kind.largest)
        warnings.push_back("they are numbers up to " + digits(kind.largest, 6) + ", the response needs " +
                           digits(last, 6));
    Numbers finite;
    std::copy_if(values.begin(), values.end(), std::back_inserter(finite), [](double x) { return std::isfinite(x); });
    if (finite.empty()) return;
    const auto is_whole = [](double x) { return x == std::nearbyint(x); };
    std::sort(finite.begin(), finite.end());
    if (std::all_of(finite.begin(), finite.end(), is_whole)) {
        std::int64_t step = 0;
        for (double x : finite)
            if (std::abs(x) < 9007199254740992.0) step = std::gcd(step, static_cast<std::int64_t>(std::abs(x)));
        const std::int64_t power = step & -step; // the largest power of two that divides all
        finite.erase(std::unique(finite.begin(), finite.end()), finite.end());
        const bool is_of_ends = !ends.empty() && std::all_of(ends.begin(), ends.end(), [&](double x) {
            return std::fmod(x, static_cast<double>(power)) == 0;
        });
        if (finite.size() > 2 && power >= min_alignment && !is_of_ends)
            warnings.push_back("they are multiples of " + std::to_string(power) +
                               ": they may be aligned to the left of their word");
        return;
    }
    if (ends.empty() || !std::all_of(ends.begin(), ends.end(), is_whole)) return;
    double squares = 0;
    const double mean = statistics::mean_of(finite);
    for (double x : finite) squares += statistics::square(x - mean);
    if (last - *std::min_element(ends.begin(), ends.end()) >= min_counts &&
        std::sqrt(squares / static_cast<double>(finite.size())) < 0.5)
        warnings.push_back("they have fractions, the response is for whole numbers up to " + digits(last, 6));
}

// Return the forces of a rest by the responses, and why it may be no rest, or in another unit.
//   rows: NaN where a taxel has no reading, or is not alive (n,)
inline Tare judged(const Learned& rest, const Frames& rows, const Kind& kind, const SkinGeometry& skin,
                   const TaxelResponses& responses, const Booleans& alive) {
    constexpr double max_offset = 3.0, max_force = 5.0, load_limit = 7.0, contact_correlation = 0.5;
    const std::size_t n = rows.n;
    Tare tare;
    tare.frames = rows.count, tare.has_noise = rest.noise.has_value();
    double total = 0, depth = 0, hidden = 0;
    std::size_t off = 0, worst = n;
    Booleans is_off(n, 0);
    for (std::size_t i = 0; i < n; ++i) {
        const double at_rest = responses.rest[i];
        const double mean = std::isfinite(rest.mean[i]) && alive[i] ? rest.mean[i] : at_rest;
        const double force = responses.force(i, mean);
        tare.forces.push_back(std::isfinite(force) ? force : 0.0);
        total += tare.forces[i];
        hidden += statistics::square(responses.force(i, at_rest + responses.sign[i] * rest.sigma[i]));
        const double below = responses.force(i, 2 * at_rest - mean);
        if (std::isfinite(below) && !rest.noise) depth += below;
        const bool is_vague = rest.noise ? rest.noise->dead[i] : rest.sigma[i] == 0;
        is_off[i] = std::abs(mean - at_rest) > max_offset * rest.sigma[i] && !is_vague;
        off += is_off[i];
    }
    const double limit = rest.noise ? rest.noise->load_limit : std::max(max_force, load_limit * std::sqrt(hidden));
    if (off > 0 || !(std::max(total, depth) <= limit)) {
        for (std::size_t i = 0; i < n; ++i)
            if ((off == 0 || is_off[i]) && (worst == n || tare.forces[i] > tare.forces[worst])) worst = i;
        std::string what = "they are those of " + digits(total, 3) + " N, with " + digits(tare.forces[worst], 2) +
                           " N on " + skin.calibration.ids[worst];
        if (off > 0) what += ", and the means of " + counted(off, "taxel") + " are off the rest of their response";
        if (depth > limit) what += "; they are as far below rest as " + digits(depth, 3) + " N are above it";
        const double mean = total / static_cast<double>(n);
        double products = 0, squares = 0;
        for (const auto& [i, j] : skin.calibration.pairs)
            products +=
                (tare.forces[static_cast<std::size_t>(i)] - mean) * (tare.forces[static_cast<std::size_t>(j)] - mean);
        for (double force : tare.forces) squares += statistics::square(force - mean) / static_cast<double>(n);
        if (!skin.calibration.pairs.empty() && squares > 0 &&
            products / static_cast<double>(skin.calibration.pairs.size()) > contact_correlation * squares)
            what += "; neighbours are alike, as under a contact";
        tare.warnings.push_back(what);
    }
    warn_of_unit(rows.values, kind, responses, tare.warnings);
    return tare;
}

// Keep the first frames of a skin, until they show that the skin is free, and how its readings scatter.
class First {
public:
    Frames rows;

    // Allocate what the frames need.
    void start(std::size_t n) {
        rows.n = n, rows.values.clear(), rows.values.reserve(max_frames * n);
        clear();
    }

    // Store a frame; return whether it is time to look at all stored ones.
    bool add(const Numbers& raw, double time) {
        if ((rows.count > 0 && time - last_ < period) || rows.count >= max_frames) return false;
        if (rows.count == 0) start_ = time;
        rows.values.insert(rows.values.end(), raw.begin(), raw.end());
        ++rows.count, last_ = time;
        if (rows.count < next_ || time - start_ < 0.5) return false;
        next_ = rows.count < max_frames ? std::min(2 * rows.count, max_frames) : max_frames + 1;
        return true;
    }

    bool is_complete() const noexcept { return rows.count >= max_frames; }

    void clear() noexcept { rows.count = 0, rows.values.clear(), next_ = AtRest::min_frames; }

private:
    std::size_t next_ = AtRest::min_frames;
    double start_ = 0, last_ = 0;
};

// Whether the noise is that of first quiet frames, in which a light even load cannot be seen: until a lift.
class Assumed {
public:
    bool is_assumed = false;

    void begin() noexcept { is_assumed = true, was_touched_ = false, free_since_ = infinity; }

    // Add a frame: after a contact, the skin is at this rest again, and the rest is right (or not), for a time [s].
    void add(bool is_touched, bool is_right, double time) noexcept {
        was_touched_ = was_touched_ || is_touched;
        if (!(was_touched_ && !is_touched && is_right))
            free_since_ = infinity;
        else if (time - free_since_ >= 2.0)
            is_assumed = false;
        else
            free_since_ = std::min(free_since_, time);
    }

private:
    bool was_touched_ = false;
    double free_since_ = infinity;
};

} // namespace rest
} // namespace skin_calib
