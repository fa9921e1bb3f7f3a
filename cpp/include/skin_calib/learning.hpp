// Learn the noise of a skin from readings without contact. See runtime/at_rest.py and noise.py, which explain formulas
// and limits. It allocates memory: `Skin::update` uses it only in the first quiet frames of a skin without noise.
#pragma once

#include "responses.hpp"

namespace skin_calib {

// Readings (frames, n), row by row.
struct Frames {
    std::size_t count = 0, n = 0;
    Numbers values;

    double& at(std::size_t frame, std::size_t i) { return values[frame * n + i]; }
    double at(std::size_t frame, std::size_t i) const { return values[frame * n + i]; }
};

namespace statistics {

inline double square(double x) { return x * x; }

inline double mean_of(const Numbers& x) {
    return std::accumulate(x.begin(), x.end(), 0.0) / static_cast<double>(x.size());
}

inline double norm_of(const Numbers& x) { return std::sqrt(std::inner_product(x.begin(), x.end(), x.begin(), 0.0)); }

// Return the means (n,) of readings.
inline Numbers means_of(const Frames& rows) {
    Numbers result(rows.n, 0.0);
    for (std::size_t f = 0; f < rows.count; ++f)
        for (std::size_t i = 0; i < rows.n; ++i) result[i] += rows.at(f, i);
    for (double& x : result) x /= static_cast<double>(rows.count);
    return result;
}

// Return the variances (n,) of readings around their means; `lost`: degrees of freedom of the mean.
inline Numbers variances_of(const Frames& rows, const Numbers& means, double lost) {
    Numbers result(rows.n, 0.0);
    for (std::size_t f = 0; f < rows.count; ++f)
        for (std::size_t i = 0; i < rows.n; ++i) result[i] += square(rows.at(f, i) - means[i]);
    for (double& x : result) x /= static_cast<double>(rows.count) - lost;
    return result;
}

// Return a quantile of numbers, as numpy.quantile.
inline double quantile(Numbers x, double q) {
    std::sort(x.begin(), x.end());
    const double at = q * static_cast<double>(x.size() - 1);
    const auto k = std::min(static_cast<std::size_t>(at), x.size() - 1), next = std::min(k + 1, x.size() - 1);
    return x[k] + (x[next] - x[k]) * (at - static_cast<double>(k));
}

inline double median(Numbers x) { return x.empty() ? 0.0 : quantile(std::move(x), 0.5); }

// Return the probability that a standard normal variable is below x.
inline double below(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// Return the same from the table of Python, with its error of interpolation up to 1e-6: levels must agree.
inline double tabulated_below(double x) {
    static const Numbers table = [] {
        Numbers values;
        for (int k = 0; k <= 3200; ++k) values.push_back(below(-8.0 + 0.005 * k));
        return values;
    }();
    const double at = (std::min(std::max(x, -8.0), 8.0) + 8.0) / 0.005;
    const auto k = std::min(static_cast<std::size_t>(at), table.size() - 2);
    return table[k] + (table[k + 1] - table[k]) * (at - static_cast<double>(k));
}

// Return the level that it exceeds with a probability, up to one half.
inline double level_above(double probability) {
    double x = 0;
    for (int k = 0; k < 100; ++k) {
        const double density = std::exp(-x * x / 2) / std::sqrt(2 * 3.141592653589793);
        const double step = (below(-x) - probability) / density;
        x += step;
        if (std::abs(step) < 1e-15 * x) break;
    }
    return x;
}

// Return the quantile of Student's distribution of a normal one `z`, with `v` degrees of freedom.
inline double student(double z, double v) {
    const double z3 = z * z * z, z5 = z3 * z * z, z7 = z5 * z * z;
    return z + (z3 + z) / 4 / v + (5 * z5 + 16 * z3 + 3 * z) / 96 / (v * v) +
           (3 * z7 + 19 * z5 + 17 * z3 - 15 * z) / 384 / (v * v * v);
}

// Return the level that all of `count` normal variables exceed with a probability; each two have a correlation.
inline double joint_quantile(double probability, double correlation, int count) {
    constexpr double width = 0.1; // of a step of the sum
    const double common = std::sqrt(std::max(correlation, 0.0));
    const double own = std::max(std::sqrt(1 - std::max(correlation, 0.0)), width), wanted = -std::log(probability);
    double before = 0, level_before = 0;
    for (int k = 0; k <= 80; ++k) {
        double every = 0;
        for (int j = -80; j <= 80; ++j) {
            const double u = width * j;
            every += std::pow(tabulated_below((common * u - width * k) / own), count) * std::exp(-u * u / 2);
        }
        const double now = -std::log(every * width / std::sqrt(2 * 3.141592653589793)), level = width * k;
        if (now >= wanted)
            return k == 0 ? level : level_before + (level - level_before) * (wanted - before) / (now - before);
        before = now, level_before = level;
    }
    return level_before;
}

// Return the step of a converter: 1, or the least difference of numbers; nothing if they never differ.
inline std::optional<double> step_of(Numbers values, bool is_whole) {
    if (is_whole) return 1.0;
    std::sort(values.begin(), values.end());
    double least = infinity;
    for (std::size_t k = 1; k < values.size(); ++k) {
        const double gap = values[k] - values[k - 1];
        if (gap > 0 && gap > 1e-9 * (values.back() - values.front())) least = std::min(least, gap);
    }
    return least < infinity ? std::optional<double>(least) : std::nullopt;
}

inline double smooth(double x) {
    x = std::min(std::max(x, 0.0), 1.0);
    return x * x * (x * -2 + 3);
}

} // namespace statistics

// Signed readings without contact, and their distribution before rounding and clipping.
class AtRest {
public:
    Frames rows; // 0 for a taxel without readings
    double step = 1, later_correlation = 0, independent_frames = 0;
    Numbers means, mean, spread, sigma, clipped; // (n,)
    Booleans dead;                               // (n,)
    Frames unit;                                 // readings with the mean 0 and the standard deviation 1

    // Return what readings show; nothing if they are too few, or none of them changes. NaN where a taxel has none.
    static std::optional<AtRest> of(const Frames& given, const Numbers& sign, bool is_whole) {
        AtRest rest;
        const std::size_t n = given.n;
        Booleans present(n, 0);
        for (std::size_t f = 0; f < given.count; ++f)
            for (std::size_t i = 0; i < n; ++i) present[i] |= std::isfinite(given.at(f, i));
        rest.rows.n = n;
        Numbers values;
        for (std::size_t f = 0; f < given.count; ++f) {
            bool is_complete = true;
            for (std::size_t i = 0; i < n; ++i) is_complete &= !present[i] || std::isfinite(given.at(f, i));
            if (!is_complete) continue;
            ++rest.rows.count;
            for (std::size_t i = 0; i < n; ++i) {
                rest.rows.values.push_back(present[i] ? given.at(f, i) * sign[i] : 0.0);
                if (present[i]) values.push_back(rest.rows.values.back());
            }
        }
        const auto step = statistics::step_of(values, is_whole);
        if (rest.rows.count < min_frames || !step || values.empty()) return std::nullopt;
        rest.step = *step;
        rest.fit();
        for (std::size_t i = 0; i < n; ++i) rest.dead[i] |= !present[i];
        if (std::find(rest.dead.begin(), rest.dead.end(), 0) == rest.dead.end()) return std::nullopt;
        rest.correlate();
        return rest;
    }

    static constexpr std::size_t min_frames = 20;

private:
    static constexpr double pooled_frames = 50.0, min_sigma = 0.25, min_clipped = 0.05, min_pile = 0.5;

public:
    // Return the degrees of freedom of the standard deviation of taxel i.
    double freedom(std::size_t i) const {
        return std::max(independent_frames * (1 - clipped[i]), 1.0) + (clipped[i] > 0 ? pooled_frames / 2 : 0.0);
    }

private:
    struct Normal {
        double mean, sigma;
    };

    static Normal moments(const Numbers& counts) {
        double total = 0, sum = 0, squares = 0;
        for (std::size_t k = 0; k < counts.size(); ++k) total += counts[k], sum += counts[k] * static_cast<double>(k);
        const double mean = sum / total;
        for (std::size_t k = 0; k < counts.size(); ++k)
            squares += counts[k] * statistics::square(static_cast<double>(k) - mean);
        return {mean, std::sqrt(squares / total + 1.0 / 12)};
    }

    // Fit a normal variable of which only a histogram is known; its lowest level has no lower end.
    static Normal censored(const Numbers& counts, Normal fit, int iterations) {
        const double total = std::accumulate(counts.begin(), counts.end(), 0.0);
        for (int round = 0; round < iterations; ++round) {
            double below = 0, density = 0, moment = 0, first = 0, second = 0;
            for (std::size_t k = 0; k < counts.size(); ++k) {
                double next = 1, next_density = 0, next_moment = 0;
                if (k + 1 < counts.size()) {
                    const double z =
                        std::min(std::max((static_cast<double>(k) + 0.5 - fit.mean) / fit.sigma, -8.0), 8.0);
                    next = statistics::tabulated_below(z),
                    next_density = std::exp(-z * z / 2) / std::sqrt(2 * 3.141592653589793);
                    next_moment = z * next_density;
                }
                const double inside = std::max(next - below, 1e-12), fraction = counts[k] / total;
                first -= fraction * (next_density - density) / inside;
                second += fraction * (1 - (next_moment - moment) / inside);
                below = next, density = next_density, moment = next_moment;
            }
            fit = {fit.mean + fit.sigma * first, fit.sigma * std::sqrt(std::max(second - first * first, 1e-4))};
        }
        return fit;
    }

    // Compute mean, standard deviation and clipping of each taxel, and which send one number only.
    void fit() {
        const std::size_t n = rows.n;
        Numbers low(n, infinity), high(n, -infinity), width(n);
        for (std::size_t f = 0; f < rows.count; ++f)
            for (std::size_t i = 0; i < n; ++i)
                low[i] = std::min(low[i], rows.at(f, i)), high[i] = std::max(high[i], rows.at(f, i));
        std::size_t levels = 1;
        const auto level_of = [&](std::size_t f, std::size_t i) {
            return static_cast<std::size_t>(std::nearbyint((rows.at(f, i) - low[i]) / width[i]));
        };
        for (std::size_t i = 0; i < n; ++i) {
            width[i] = std::max(step, (high[i] - low[i]) / 32);
            levels = std::max(levels, static_cast<std::size_t>(std::nearbyint((high[i] - low[i]) / width[i])) + 1);
        }
        std::vector<Numbers> counts(n, Numbers(levels, 0.0));
        for (std::size_t f = 0; f < rows.count; ++f)
            for (std::size_t i = 0; i < n; ++i) ++counts[i][level_of(f, i)];
        const auto pool = [&](const Booleans& chosen) {
            Numbers pooled(levels, 0.0);
            for (std::size_t i = 0; i < n; ++i)
                for (std::size_t k = 0; chosen[i] && width[i] == step && k < levels; ++k) pooled[k] += counts[i][k];
            const double total = std::max(std::accumulate(pooled.begin(), pooled.end(), 0.0), 1.0);
            for (double& x : pooled) x /= total;
            return pooled;
        };
        const Numbers all = pool(Booleans(n, 1));
        double most = *std::max_element(all.begin(), all.end());
        if (most == 0) most = 1;
        means = mean = statistics::means_of(rows);
        const Numbers variances = statistics::variances_of(rows, mean, 1);
        const auto frames = static_cast<double>(rows.count);
        Booleans chosen(n, 0);
        for (std::size_t i = 0; i < n; ++i) {
            dead.push_back(low[i] == high[i] && frames * std::log(most) < std::log(1e-6));
            spread.push_back(std::sqrt(std::max(variances[i] - step * step / 12, 0.0)));
            chosen[i] =
                counts[i][0] / frames > min_clipped && counts[i][0] >= min_pile * (levels > 1 ? counts[i][1] : 0.0);
            clipped.push_back(chosen[i] ? counts[i][0] / frames : 0.0);
        }
        const Numbers pooled = pool(chosen);
        const bool has_pool = *std::max_element(pooled.begin(), pooled.end()) > 0;
        const Normal of_all = has_pool ? censored(pooled, moments(pooled), 200) : Normal{0, 1};
        for (std::size_t i = 0; i < n; ++i) {
            if (chosen[i]) {
                const bool is_similar = has_pool && width[i] == step;
                const Normal start = is_similar ? of_all : moments(counts[i]);
                for (std::size_t k = 0; is_similar && k < levels; ++k) counts[i][k] += pooled_frames * pooled[k];
                const Normal own = censored(counts[i], start, 60);
                mean[i] = low[i] + width[i] * own.mean, spread[i] = width[i] * own.sigma;
            }
            spread[i] = std::max(spread[i], min_sigma * step);
            sigma.push_back(std::sqrt(spread[i] * spread[i] + step * step / 12));
        }
    }

    void correlate() {
        const Numbers variances = statistics::variances_of(rows, means, 0);
        unit = rows;
        double sum = 0, live = 0;
        for (std::size_t f = 0; f < rows.count; ++f)
            for (std::size_t i = 0; i < rows.n; ++i)
                unit.at(f, i) = (rows.at(f, i) - means[i]) / std::max(std::sqrt(variances[i]), min_sigma * step);
        for (std::size_t f = 1; f < rows.count; ++f)
            for (std::size_t i = 0; i < rows.n; ++i)
                if (!dead[i]) sum += unit.at(f, i) * unit.at(f - 1, i), ++live;
        later_correlation = std::max(sum / live, 0.0);
        const double square = later_correlation * later_correlation;
        independent_frames = static_cast<double>(rows.count) * (1 - square) / (1 + square);
    }
};

// Return the noise of readings at rest, without its baseline; nothing if they say nothing about it.
//   given: NaN where a taxel has no reading; pairs: of neighbours; `is_whole`: whether the converter sends whole
//   numbers
inline std::optional<Noise> learned(const Frames& given, const TaxelResponses& responses,
                                    const std::vector<std::array<std::int32_t, 2>>& pairs, bool is_whole) {
    using namespace statistics;
    constexpr double max_false_sure = 3e-4, max_false_load = 2e-4, max_false_pair = 1e-4, possible = 2.4;
    constexpr double release = 1.5, weight_start = 1.0, weight_full = 3.0, below_rest = 2.0, limit_margin = 3.2;
    constexpr double min_tail_probability = 0.01, tail_factor = 2.0, max_repeat_probability = 1e-8, load_limit = 7.0;
    const std::optional<AtRest> found = AtRest::of(given, responses.sign, is_whole);
    if (!found) return std::nullopt;
    const AtRest& rest = *found;
    const std::size_t n = given.n, frames = rest.rows.count;
    const auto count = static_cast<double>(frames);
    Noise noise;
    noise.is_known = true;
    noise.mean = rest.mean, noise.sigma = rest.sigma, noise.dead = rest.dead, noise.free = rest.means;
    const auto live = static_cast<double>(std::count(rest.dead.begin(), rest.dead.end(), 0));

    // levels of touch: quantiles of Student's distribution, and guards against rare large readings
    double alike = 0;
    for (std::size_t f = 0; f < frames; ++f)
        for (const auto& [i, j] : pairs)
            alike += rest.unit.at(f, static_cast<std::size_t>(i)) * rest.unit.at(f, static_cast<std::size_t>(j));
    if (!pairs.empty()) alike /= count * static_cast<double>(pairs.size());
    const double false_sure = max_false_sure / 2 / live,
                 pair_count = static_cast<double>(std::max<std::size_t>(pairs.size(), 1));
    const double one = level_above(1 - (1 - false_sure)), pair = joint_quantile(max_false_pair / pair_count, alike, 2);
    double three = joint_quantile(false_sure, rest.later_correlation, 3);
    Numbers above;
    for (std::size_t f = 0; f < frames; ++f)
        for (std::size_t i = 0; i < n; ++i)
            if (!rest.dead[i]) above.push_back((rest.rows.at(f, i) - rest.mean[i] - rest.step / 2) / rest.spread[i]);
    const double largest = *std::max_element(above.begin(), above.end());
    const bool has_tail = largest > level_above(1 - (1 - min_tail_probability / static_cast<double>(above.size())));
    if (has_tail) three = std::max(three, quantile(above, below(three)));
    for (std::size_t i = 0; i < n; ++i) {
        const double start = rest.mean[i] + rest.step / 2, freedom = rest.freedom(i);
        const double guard = has_tail ? start + tail_factor * largest * rest.spread[i] : -infinity;
        noise.sure.push_back(std::max(start + rest.spread[i] * student(one, freedom), guard));
        noise.lasting.push_back(start + rest.spread[i] * student(three, freedom));
        noise.pair.push_back(std::max(start + rest.spread[i] * student(pair, freedom), guard));
        noise.possible.push_back(rest.mean[i] + possible * rest.sigma[i]);
        noise.release.push_back(rest.mean[i] + release * rest.sigma[i]);
        noise.lowest.push_back(rest.mean[i] - below_rest * (noise.sure[i] - rest.mean[i]));
        const double limit = possible * rest.sigma[i] + rest.step / 2 + limit_margin * rest.spread[i];
        noise.detection_limits.push_back(responses.force(i, responses.rest[i] + responses.sign[i] * limit));
        const double end = responses.rest[i] + 4 * responses.sign[i] * rest.sigma[i];
        const double rise = responses.force(i, end) - responses.force(i, responses.rest[i]);
        const double slope = rest.dead[i] ? 0.0 : rise / (4 * rest.sigma[i]);
        noise.slopes.push_back(std::isfinite(slope) ? slope : 0.0);
    }

    // repeated numbers, and what the clipping hides
    double of_frames = 0;
    for (std::size_t i = 0; i < n; ++i) {
        Numbers column;
        for (std::size_t f = 0; f < frames; ++f) column.push_back(rest.rows.at(f, i));
        std::sort(column.begin(), column.end());
        std::size_t run = 1, longest = 1;
        for (std::size_t f = 1; f < frames; ++f)
            run = column[f] == column[f - 1] ? run + 1 : 1, longest = std::max(longest, run);
        const double centred = 1 - 2 * tabulated_below(-rest.step / 2 / rest.spread[i]);
        const double most = std::max(centred, static_cast<double>(longest) / count);
        const double of_one = rest.dead[i] ? 1.0 : rest.clipped[i] > 0 ? centred : most;
        noise.repeats.push_back(-std::log(max_repeat_probability) / std::abs(std::log(of_one)));
        of_frames += rest.dead[i] ? 0.0 : std::log(most);
        const double low = column.front();
        noise.clip.push_back(rest.clipped[i] > 0 ? low : -infinity);
        const auto at_low = static_cast<double>(std::upper_bound(column.begin(), column.end(), low) - column.begin());
        const double hidden = low - rest.mean[i] - (rest.means[i] - rest.mean[i]) / (at_low / count);
        noise.below_clip.push_back(std::min(hidden * noise.slopes[i], 0.0));
    }
    noise.frame_repeats = -std::log(max_repeat_probability) / std::abs(of_frames);

    // the sum of all taxels
    Numbers sums(frames, 0.0), alone, noisy;
    const Numbers variances = variances_of(rest.rows, rest.means, 1);
    for (std::size_t f = 0; f < frames; ++f)
        for (std::size_t i = 0; i < n; ++i) sums[f] += rest.rows.at(f, i) * noise.slopes[i];
    noise.free_sum = mean_of(sums);
    double second = 0, third = 0, passes = 0, leaves_out = 0;
    for (double x : sums)
        second += square(x - noise.free_sum), third += square(x - noise.free_sum) * (x - noise.free_sum);
    const double deviation = std::sqrt(second / (count - 1));
    const double skewness = deviation > 0 ? third / count / (deviation * deviation * deviation) : 0.0;
    const double k = student(level_above(1 - (1 - max_false_load)), std::max(rest.independent_frames - 1, 1.0));
    noise.load_level = std::max((k + (k * k - 1) * std::max(skewness, 0.0) / 6) * deviation,
                                rest.step * *std::max_element(noise.slopes.begin(), noise.slopes.end()));
    for (std::size_t i = 0; i < n; ++i) {
        alone.push_back(noise.slopes[i] * std::sqrt(variances[i]));
        noisy.push_back(noise.slopes[i] * rest.sigma[i]);
        for (std::size_t f = 0; f < frames; ++f) {
            const double d = (rest.rows.at(f, i) - rest.mean[i]) / rest.sigma[i];
            const double weight = smooth((d - weight_start) / (weight_full - weight_start));
            passes += weight * d * noisy[i], leaves_out += (1 - weight) * noisy[i];
        }
    }
    const bool has_sum = norm_of(alone) > 1e-9 * norm_of(noisy); // otherwise rounding
    noise.common = has_sum ? std::max(1.0, deviation / norm_of(alone)) : 1.0;
    noise.load_limit = load_limit * noise.common * norm_of(noisy);
    for (double x : noisy)
        noise.rectified.push_back(x * (passes / std::max(leaves_out, std::numeric_limits<double>::min())));
    return noise;
}

} // namespace skin_calib
