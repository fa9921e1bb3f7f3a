// Which taxels are touched: surely, possibly, and in the estimate between. See runtime/touched.py and noise.py.
#pragma once

#include "geometry.hpp"

namespace skin_calib {

// What is touched in one frame.
struct Touched {
    Booleans active;            // (n,) whether a taxel is in a contact
    Booleans sure;              // (n,) whether it is surely touched; all 0 without `has_sure`
    Booleans possible;          // (n,) whether it is possibly touched
    Numbers weights, pushes;    // (n,) of its force in the sums; its part of the sums [N]
    bool has_sure = false;      // whether something can be sure: otherwise noise and thresholds are unknown
    double common = 0;          // deviation of all taxels that may be a drift [standard deviations]
    double excess = 0;          // sum of all taxels above that at rest [N]; 0 without noise
    std::optional<bool> stands; // whether there is a load; nothing if sums of the noise are unknown: then 5 N decide

    void resize(std::size_t n) {
        for (auto* list : {&active, &sure, &possible}) list->assign(n, 0);
        weights.assign(n, 0.0), pushes.assign(n, 0.0);
    }

    // The readings of some taxels (n,) prove nothing: with a load, they are possibly touched.
    void leave_out(const Booleans& stuck) noexcept {
        if (!has_sure || !stands.value_or(true)) return;
        for (std::size_t i = 0; i < stuck.size(); ++i) {
            sure[i] = sure[i] && !stuck[i];
            possible[i] |= stuck[i];
        }
    }
};

// Decide which taxels are touched, and keep what later frames need: the active taxels, and the last three frames.
class Toucher {
public:
    // Set thresholds [N] (`is_stated`: by the caller), or the noise of the skin. The skin must live as long.
    void start(const SkinGeometry& skin, const Noise* noise, double switch_on, double switch_off, bool is_stated) {
        const std::size_t n = skin.n;
        skin_ = &skin, is_stated_ = is_stated, on_ = switch_on, off_ = switch_off;
        for (auto* list : {&before_, &sure_, &pair_, &release_, &possible_, &starts_, &lasting_}) list->assign(n, 0);
        for (auto& list : above_) list.assign(n, 0);
        signed_.assign(n, 0.0), deviations_.assign(n, 0.0);
        set_noise(noise);
    }

    // Set the noise of the skin, or nullptr; what is touched stays.
    void set_noise(const Noise* noise) {
        noise_ = is_stated_ ? nullptr : noise;
        scale_.clear(), offset_.clear(), offsets_.clear(), total_ = 0;
        for (std::size_t i = 0; noise_ && i < skin_->n; ++i) {
            const double scale = 1 / (noise_->sigma[i] * (weight_full - weight_start));
            scale_.push_back(scale);
            offset_.push_back(-noise_->mean[i] * scale - weight_start / (weight_full - weight_start));
            offsets_.push_back(noise_->rectified[i] - noise_->free[i] * noise_->slopes[i]);
            total_ += noise_->rectified[i];
        }
    }

    // Forget the frames before: they say nothing about the next one.
    void forget() noexcept {
        std::fill(before_.begin(), before_.end(), 0);
        for (auto& list : above_) std::fill(list.begin(), list.end(), 0);
    }

    // Decide what is touched in the next frame.
    //   signed_readings, forces, known: (n,) of the frame; `is_complete`: all are known; `is_new`: a reading has
    //   changed
    void decide(const Numbers& signed_readings, const Numbers& forces, const Booleans& known, bool is_complete,
                bool is_new, Touched& sets) noexcept {
        if (noise_)
            by_noise(signed_readings, forces, known, is_complete, is_new, sets);
        else
            by_thresholds(forces, known, is_complete, sets);
    }

private:
    // [standard deviations] and [1] Step of the weights, and load of taxels with little weight: see runtime/noise.py.
    static constexpr double weight_start = 1.0, weight_full = 3.0, hidden_start = 0.1, hidden_full = 0.3;

    void by_thresholds(const Numbers& forces, const Booleans& known, bool is_complete, Touched& sets) noexcept {
        const std::size_t n = skin_->n;
        bool any = false;
        for (std::size_t i = 0; i < n; ++i) {
            before_[i] = forces[i] >= on_ || (before_[i] && (forces[i] >= off_ || !known[i]));
            sets.active[i] = before_[i] && known[i];
            any = any || sets.active[i];
        }
        for (std::size_t i = 0; i < n; ++i) {
            sets.sure[i] = is_stated_ && sets.active[i];
            sets.possible[i] = sets.active[i] || (!is_complete && any && !known[i]);
            sets.weights[i] = sets.active[i];
            sets.pushes[i] = sets.weights[i] * forces[i];
        }
        sets.has_sure = is_stated_;
        sets.stands = std::nullopt;
        sets.excess = sets.common = 0;
    }

    void by_noise(const Numbers& given, const Numbers& forces, const Booleans& known, bool is_complete, bool is_new,
                  Touched& sets) noexcept {
        const Noise& noise = *noise_;
        const std::size_t n = skin_->n;
        if (is_new) {
            std::swap(above_[1], above_[2]);
            std::swap(above_[0], above_[1]);
        }
        double excess = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double x = signed_[i] = known[i] ? given[i] : noise.free[i]; // as without contact, for the sums
            const bool has_force = forces[i] > 0;
            sure_[i] = has_force && x > noise.sure[i];
            pair_[i] = has_force && x > noise.pair[i];
            release_[i] = has_force && x > noise.release[i];
            possible_[i] = x > noise.possible[i];
            lasting_[i] = has_force && x > noise.lasting[i];
            excess += x * noise.slopes[i];
        }
        excess -= noise.free_sum;
        bool has_load = excess > noise.load_level;
        for (std::size_t i = 0; i < n; ++i) {
            starts_[i] = sure_[i] || (pair_[i] && has_neighbour_in_pair(i));
            has_load = has_load || starts_[i];
        }
        const double common = has_load ? common_deviation(given, known, is_complete) : 0.0;
        for (std::size_t i = 0; common > 0 && i < n; ++i) {
            const double lower = given[i] - common * noise.sigma[i];
            sure_[i] = sure_[i] && lower > noise.sure[i];
            lasting_[i] = lasting_[i] && lower > noise.lasting[i];
        }
        if (is_new) std::copy(lasting_.begin(), lasting_.end(), above_[0].begin());
        for (std::size_t i = 0; i < n; ++i) {
            before_[i] = starts_[i] || (before_[i] && ((has_load && release_[i]) || !known[i]));
            sets.active[i] = before_[i] && known[i];
            const bool lasts = has_load && above_[0][i] && above_[1][i] && above_[2][i];
            sets.sure[i] = has_load && (sure_[i] || lasts);
            sets.possible[i] = has_load && (possible_[i] || !known[i] || lasts || sets.active[i]);
        }
        sets.has_sure = true;
        sets.stands = has_load;
        sets.excess = excess, sets.common = common;
        if (has_load) {
            weigh(forces, excess, sets);
        } else {
            std::fill(sets.weights.begin(), sets.weights.end(), 0.0);
            std::fill(sets.pushes.begin(), sets.pushes.end(), 0.0);
        }
        for (std::size_t i = 0; !is_complete && i < n; ++i)
            if (!known[i]) sets.pushes[i] = 0.0;
    }

    // Return how far a drift may have raised all readings [standard deviations]: as the lowest quarter of the known
    // ones.
    double common_deviation(const Numbers& given, const Booleans& known, bool is_complete) noexcept {
        const double quarter = -0.6744897501960818, max_drift = 0.3, max_common = 5.0; // see runtime/noise.py
        const Noise& noise = *noise_;
        const double rest = quarter + max_drift;
        std::size_t total = 0, low = 0, high = 0;
        for (std::size_t i = 0; i < skin_->n; ++i) {
            if (!is_complete && !known[i]) continue;
            const double from = noise.mean[i] + rest * noise.sigma[i];
            low += given[i] <= std::max(from, noise.clip[i]);
            high += given[i] <= from + max_common * noise.sigma[i];
            deviations_[total++] = given[i] * (1 / noise.sigma[i]) + (-noise.mean[i] / noise.sigma[i] - rest);
        }
        const std::size_t count = std::max<std::size_t>(total / 4, 1);
        if (low >= count) return 0.0;
        if (high < count) return max_common;
        const auto begin = deviations_.begin(), at = begin + static_cast<std::ptrdiff_t>(count - 1);
        std::nth_element(begin, at, begin + static_cast<std::ptrdiff_t>(total));
        return std::min(std::max(*at, 0.0), max_common);
    }

    bool has_neighbour_in_pair(std::size_t i) const noexcept {
        for (std::size_t k = skin_->begin(i); k < skin_->end(i); ++k)
            if (pair_[skin_->neighbour(k)]) return true;
        return false;
    }

    // Compute weights and parts of the sums: weak readings count less, but their load counts if it is much of the sum.
    void weigh(const Numbers& forces, double excess, Touched& sets) noexcept {
        const Noise& noise = *noise_;
        double clear = 0, of_offsets = 0;
        for (std::size_t i = 0; i < skin_->n; ++i) {
            const double x = std::min(std::max(signed_[i] * scale_[i] + offset_[i], 0.0), 1.0);
            sets.weights[i] = x * x * (x * -2 + 3);
            clear += sets.weights[i] * signed_[i] * noise.slopes[i];
            of_offsets += sets.weights[i] * offsets_[i];
        }
        clear = clear + of_offsets - total_; // load of the taxels that are clear of the noise [N]
        const bool is_hidden = excess > (1 + hidden_start) * clear;
        double hidden = 1.0;
        if (is_hidden && clear > 0)
            hidden = std::min((excess / clear - 1 - hidden_start) / (hidden_full - hidden_start), 1.0);
        for (std::size_t i = 0; i < skin_->n; ++i) {
            double force = forces[i];
            if (is_hidden) {
                sets.weights[i] += hidden * (1 - sets.weights[i]);
                const double x = signed_[i];
                force +=
                    std::min(x <= noise.clip[i] ? noise.below_clip[i] : (x - noise.mean[i]) * noise.slopes[i], 0.0);
            }
            sets.pushes[i] = (force + noise.rectified[i]) * sets.weights[i] - noise.rectified[i];
        }
    }

    const SkinGeometry* skin_ = nullptr;
    const Noise* noise_ = nullptr;
    bool is_stated_ = false;
    double on_ = 0.2, off_ = 0.1, total_ = 0;
    Booleans before_, sure_, pair_, release_, possible_, starts_, lasting_;
    std::array<Booleans, 3> above_; // which taxels exceeded `lasting` in the last new frames
    Numbers signed_, deviations_, scale_, offset_, offsets_;
};

} // namespace skin_calib
