// Responses of all taxels: readings in, forces out. The order of the operations is that of NumPy, so that bits agree.
#pragma once

#include "types.hpp"

namespace skin_calib {

class TaxelResponses {
public:
    Numbers rest, full, sign; // (n,) reading without force; at saturation; 1 if readings rise with the force, or -1

    TaxelResponses() = default;

    explicit TaxelResponses(const Calibration& c) : of_(c.response.begin(), c.response.end()) {
        std::vector<std::uint8_t> is_used(c.responses.size(), 0);
        for (std::size_t k : of_) is_used[k] = 1;
        int tables = 0;
        for (std::size_t k = 0; k < c.responses.size(); ++k)
            kinds_.push_back(kind_of(c.responses[k], is_used[k] && c.responses[k].is_table() ? tables++ : 0));
        is_one_polynomial_ = std::count(is_used.begin(), is_used.end(), 1) == 1 && tables == 0;
        for (std::size_t k : of_) {
            const Response& r = c.responses[k];
            rest.push_back(r.rest());
            full.push_back(r.full());
            sign.push_back(full.back() < rest.back() ? -1.0 : 1.0);
        }
    }

    // Return the force of a reading of taxel i [N], never negative; NaN if the reading or the force is not finite.
    double force(std::size_t i, double reading) const noexcept {
        const Kind& kind = kinds_[of_[i]];
        const double force = kind.knots.empty() ? polynomial(kind, reading) : table(kind, reading);
        return std::isfinite(force) ? std::max(force, 0.0) : not_a_number;
    }

    // Compute the forces (n,) of readings (n,), as `force` does. With one polynomial for all, compilers vectorize it.
    void forces_of(const Numbers& readings, Numbers& forces) const noexcept {
        const std::size_t n = of_.size();
        if (!is_one_polynomial_) {
            for (std::size_t i = 0; i < n; ++i) forces[i] = force(i, readings[i]);
            return;
        }
        const Kind& kind = kinds_[of_[0]];
        const double low = kind.low, high = kind.high;
        const double* x = readings.data();
        double* sum = forces.data();
        std::fill(sum, sum + n, kind.coefficients[0]);
        for (std::size_t k = 1; k < kind.coefficients.size(); ++k) {
            const double c = kind.coefficients[k];
            for (std::size_t i = 0; i < n; ++i) sum[i] = sum[i] * std::min(std::max(x[i], low), high) + c;
        }
        for (std::size_t i = 0; i < n; ++i) // NaN, or infinity less itself, for what is not finite
            sum[i] = std::max(sum[i], 0.0) + ((sum[i] - sum[i]) + (x[i] - x[i]));
    }

    // Return whether a reading of taxel i is at or beyond the saturation reading, where the force may be larger.
    bool saturated(std::size_t i, double reading) const noexcept {
        const double signed_reading = reading * sign[i];
        return signed_reading >= sign[i] * full[i] && signed_reading < infinity;
    }

private:
    struct Kind {
        Numbers coefficients; // highest power first
        double low, high;
        Numbers knots, forces; // of a table: [0, 1] is its range, shifted by 2 for each earlier table as in NumPy
        double width, shift;
    };

    static Kind kind_of(const Response& r, int number) {
        Kind kind{{r.coefficients.rbegin(), r.coefficients.rend()}, -infinity, infinity, {}, r.forces, 0, 2.0 * number};
        if (kind.coefficients.size() < 2) kind.coefficients.insert(kind.coefficients.begin(), 0.0);
        if (r.range) kind.low = (*r.range)[0], kind.high = (*r.range)[1];
        if (r.is_table()) {
            kind.low = r.readings.front();
            kind.width = r.readings.back() - r.readings.front();
            for (double x : r.readings) kind.knots.push_back((x - kind.low) / kind.width + kind.shift);
        }
        return kind;
    }

    // Evaluate a polynomial by Horner's scheme; not finite for a reading that is not.
    static double polynomial(const Kind& kind, double reading) noexcept {
        if (!std::isfinite(reading)) return not_a_number;
        const double x = std::min(std::max(reading, kind.low), kind.high);
        double sum = kind.coefficients[0];
        for (std::size_t k = 1; k < kind.coefficients.size(); ++k) sum = sum * x + kind.coefficients[k];
        return sum;
    }

    // Interpolate in a table, as numpy.interp.
    static double table(const Kind& kind, double reading) noexcept {
        if (!std::isfinite(reading)) return not_a_number;
        const double x = std::min(std::max((reading - kind.low) / kind.width, 0.0), 1.0) + kind.shift;
        const auto above = std::upper_bound(kind.knots.begin(), kind.knots.end(), x);
        const std::size_t j = std::max<std::ptrdiff_t>(above - kind.knots.begin() - 1, 0);
        if (j + 1 == kind.knots.size() || kind.knots[j] == x) return kind.forces[j];
        const double slope = (kind.forces[j + 1] - kind.forces[j]) / (kind.knots[j + 1] - kind.knots[j]);
        const double force = slope * (x - kind.knots[j]) + kind.forces[j];
        return std::isnan(force) ? slope * (x - kind.knots[j + 1]) + kind.forces[j + 1] : force;
    }

    bool is_one_polynomial_ = false; // whether all taxels have the same polynomial
    std::vector<std::size_t> of_;    // (n,) kind of each taxel
    std::vector<Kind> kinds_;
};

} // namespace skin_calib
