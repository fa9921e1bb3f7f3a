// The skin of one link: readings in, a frame out. See runtime/skin.py, readings.py and frame.py.
#pragma once

#include "drift.hpp"
#include "faults.hpp"
#include "frame.hpp"
#include "lost.hpp"
#include "rest.hpp"

namespace skin_calib {

// A skin whose `update` allocates no memory, takes no locks and throws nothing. One thread at a time may call it.
class Skin {
public:
    Skin() = default;
    Skin(const Skin&) = delete; // its parts refer to each other
    Skin& operator=(const Skin&) = delete;

    // Set calibration, options and what `tare` learnt (or nullptr). After an error the skin is unusable.
    Status start(const Calibration& calibration, const Options& options = {}, const Noise* noise = nullptr) {
        is_ready_ = false;
        if (Status status = check(calibration); !status.ok) return status;
        const std::size_t n = calibration.ids.size();
        if (noise)
            if (Status status = check(*noise, n); !status.ok) return status;
        const bool is_stated = options.switch_on || options.switch_off;
        const double on = options.switch_on.value_or(options.switch_off ? *options.switch_off * (0.2 / 0.1) : 0.2);
        const double off = options.switch_off.value_or(on * (0.1 / 0.2));
        if (!(0 < off && off <= on && on < infinity))
            return Status::error("switch_off must be positive and at most switch_on");
        if (options.creep && !((*options.creep)[0] >= 0 && (*options.creep)[1] > 0 && all_finite(*options.creep)))
            return Status::error("creep must be a fraction of at least 0 and a time above 0 s");
        const std::optional<Plane> plane = options.ground ? options.ground : ground_of(calibration);
        if (plane)
            if (Status status = check(*plane); !status.ok) return status;

        geometry = SkinGeometry(calibration);
        responses = TaxelResponses(calibration);
        ground = plane ? std::optional<GroundGeometry>(std::in_place, geometry, *plane) : std::nullopt;
        no_ground_ = Terms{};
        no_ground_.link = geometry.terms;
        squares_.clear();
        for (const auto& terms : geometry.terms) {
            no_ground_.rows.emplace_back();
            std::copy(terms.begin() + 5, terms.end(), no_ground_.rows.back().begin());
            squares_.emplace_back();
            std::transform(terms.begin() + 5, terms.end(), squares_.back().begin(), [](double x) { return x * x; });
        }
        terms_ = ground ? (options.in_cell ? &ground->in_cell : &ground->plain) : &no_ground_;
        baseline_ = noise ? noise->baseline : Numbers(n, 0.0);
        noise_ = noise && noise->is_known ? std::optional<Noise>(*noise) : std::nullopt;
        creep_ = std::nullopt;
        if (options.creep) creep_.emplace().start(n, (*options.creep)[0], (*options.creep)[1]);
        toucher_.start(geometry, noise_ ? &*noise_ : nullptr, on, off, is_stated);
        faults_.start(responses, noise_ ? &*noise_ : nullptr);
        follows_drift_ = options.follow_drift;
        if (noise_) drift_.start(geometry, *noise_, responses.sign, follows_drift_);
        switch_on_ = on, is_stated_ = is_stated;
        assumed_ = {};
        seek_rest();
        finder_.start(geometry);
        lost_.start(geometry);
        length_ = 0;
        most_.clear();
        for (std::size_t i = 0; i < n; ++i) {
            length_ = std::max(length_, static_cast<std::size_t>(calibration.channels[i]) + 1);
            const double measured = std::isfinite(responses.full[i]) ? responses.force(i, responses.full[i]) : 0.0;
            most_.push_back(std::max(std::max(1e7 * calibration.areas[i], 100.0), measured));
        }
        alive_.assign(n, 1);
        limit();
        for (auto* list : {&raw_, &shifted_, &signed_, &variances_, &forces_, &sides_, &low_, &high_})
            list->assign(n, 0.0);
        clock_ = Clock{};
        allocate_frame();
        is_ready_ = true;
        return {};
    }

    const std::vector<std::string>& ids() const noexcept { return geometry.calibration.ids; }

    std::size_t size() const noexcept { return geometry.n; }

    // Minimum length of a reading: the highest channel plus one.
    std::size_t reading_length() const noexcept { return length_; }

    const std::optional<Noise>& noise() const noexcept { return noise_; }

    // Force of each taxel from which on it counts as possibly touched [N].
    Numbers thresholds() const {
        return is_stated_ || !noise_ ? Numbers(size(), switch_on_) : noise_->detection_limits;
    }

    // Leave out defective taxels from now on; an empty list masks none. After an error the masked taxels stay as
    // before.
    Status mask(const std::vector<std::string>& masked) {
        Booleans alive(size(), 1);
        for (const std::string& id : masked) {
            const auto found = std::find(ids().begin(), ids().end(), id);
            if (found == ids().end())
                return Status::error("no taxel '" + id + "' on the skin of " + geometry.calibration.link);
            alive[static_cast<std::size_t>(found - ids().begin())] = 0;
        }
        alive_ = alive;
        limit();
        return {};
    }

    // Set the baseline: these readings are without contact. Frames of a second, 20 at least, also give the noise. They
    // are refused if something presses during some of them, and with a warning, unless it is accepted. Then nothing
    // changes.
    //   readings: (frames, channels), of the type of later readings; `learned`: what they say, also after a refusal
    template <class Number>
    Status tare(const Number* readings, std::size_t frames, std::size_t channels, Tare& learned, bool accept = false) {
        learned = {};
        if (!is_ready_) return Status::error("the skin is not started");
        if (readings == nullptr || frames == 0 || channels < length_)
            return Status::error("the reading has " + std::to_string(channels) + " channels, the skin of " +
                                 geometry.calibration.link + " needs " + std::to_string(length_));
        const std::size_t n = size();
        Frames rows{frames, n, Numbers(frames * n)}, alive = rows;
        for (std::size_t f = 0; f < frames; ++f)
            for (std::size_t i = 0; i < n; ++i) {
                const auto channel = static_cast<std::size_t>(geometry.calibration.channels[i]);
                rows.at(f, i) = static_cast<double>(readings[f * channels + channel]);
                alive.at(f, i) = alive_[i] ? rows.at(f, i) : not_a_number;
            }
        const Kind kind = Kind::of<Number>();
        const Numbers forces = rest::contacts_during(alive, responses, kind.is_whole);
        const auto most = std::max_element(forces.begin(), forces.end());
        if (*most >= switch_on_)
            return Status::error(
                "the " + std::to_string(frames) + " readings for a tare are not at rest: the force changes by " +
                rest::digits(*most, 2) + " N on " + ids()[static_cast<std::size_t>(most - forces.begin())] +
                ". Use a second or more without contact, or mask the taxel if it is defective");
        const rest::Learned found = rest::examined(rows, geometry, responses, kind.is_whole);
        learned = rest::judged(found, alive, kind, geometry, responses, alive_);
        if (!learned.warnings.empty() && !accept) {
            std::string all;
            for (const std::string& warning : learned.warnings) all += (all.empty() ? "" : "; ") + warning;
            return Status::error("the readings for a tare are refused: " + all +
                                 ". Lift the skin, or check the response. If nothing presses, and the sensors read "
                                 "this at rest, accept the warnings");
        }
        faults_.byte_order.learn(rows);
        learn(found);
        assumed_.is_assumed = false;
        seek_rest();
        return {};
    }

    // Added to each reading (n,), so that the one at rest gives no force.
    const Numbers& baseline() const noexcept { return baseline_; }

    // Return the frame of one reading; it is valid until the next call. A wrong reading gives a frame with flags.
    //   readings: (count,) of any type of numbers, one frame of the electronics; `time`: of the reading [s]
    template <class Number> const Frame& update(const Number* readings, std::size_t count, double time) noexcept {
        const Flags flags = clock_.flags(time);
        kind_ = Kind::of<Number>();
        if (!is_ready_ || readings == nullptr || count < length_) return unknown(time, flags | flag::wrong_length);
        for (std::size_t i = 0; i < size(); ++i)
            raw_[i] = static_cast<double>(readings[static_cast<std::size_t>(geometry.calibration.channels[i])]);
        return update_from_taxels(time, flags);
    }

    SkinGeometry geometry;
    TaxelResponses responses;
    std::optional<GroundGeometry> ground;

private:
    static constexpr double max_reading = 1e100;

    // Flags of frames that are not part of a rest, and of those whose readings are not those of the rest learned.
    static constexpr Flags not_at_rest = flag::time_back | flag::time_jump | flag::byte_order;
    static constexpr Flags not_that_rest = not_at_rest | flag::drift | flag::below_rest | flag::frozen;

    // Learn from the first quiet frames of now on, if nothing else says what a contact is.
    void seek_rest() {
        first_ = std::nullopt;
        if (!noise_ && !is_stated_) first_.emplace().start(size());
    }

    // Set the baseline, and the noise; of too few frames for the noise, it moves to their mean.
    void learn(const rest::Learned& found) {
        std::optional<Noise> noise = found.noise;
        if (!noise && noise_) {
            noise = noise_;
            for (std::size_t i = 0; i < size(); ++i) {
                if (!std::isfinite(found.mean[i])) continue;
                const double change = found.mean[i] * responses.sign[i] - noise_->mean[i];
                for (auto* level : {&noise->mean, &noise->sure, &noise->lasting, &noise->pair, &noise->possible,
                                    &noise->release, &noise->lowest, &noise->free, &noise->clip})
                    (*level)[i] += change;
                noise->free_sum += change * noise->slopes[i];
            }
        }
        for (std::size_t i = 0; i < size(); ++i)
            if (std::isfinite(found.mean[i])) baseline_[i] = responses.rest[i] - found.mean[i];
        noise_ = noise;
        if (noise_) noise_->baseline = baseline_, drift_.start(geometry, *noise_, responses.sign, follows_drift_);
        toucher_.set_noise(noise_ ? &*noise_ : nullptr);
        faults_.set_noise(noise_ ? &*noise_ : nullptr);
        if (creep_) creep_->restart();
        limit();
    }

    // Add a frame to the first ones; after enough quiet ones, learn baseline and noise. These calls allocate memory.
    void learn_at_start(double time) noexcept {
        if ((frame_.flags & not_at_rest) != 0 || !std::isfinite(time)) return first_->clear();
        if (!first_->add(raw_, time)) return;
        if (rest::is_rest(first_->rows, kind_.is_whole)) {
            const rest::Learned found = rest::examined(first_->rows, geometry, responses, kind_.is_whole);
            const Tare tare = rest::judged(found, first_->rows, kind_, geometry, responses, alive_);
            if (found.noise && tare.warnings.empty()) {
                faults_.byte_order.learn(first_->rows);
                learn(found);
                assumed_.begin();
                if (first_->is_complete()) first_ = std::nullopt;
                return;
            }
        }
        if (noise_)
            first_ = std::nullopt; // a contact ends the rest; the noise of its first frames stays
        else
            first_->clear();
    }

    // Allocate everything that frames need.
    void allocate_frame() {
        frame_ = Frame{};
        frame_.forces.assign(size(), 0.0);
        for (auto* list : {&frame_.known, &frame_.saturated, &frame_.stuck}) list->assign(size(), 0);
        frame_.sets.resize(size());
        standing_.resize(size());
        frame_.force_sigmas.reserve(size());
        frame_.lost.assign(size(), 0.0);
        frame_.rows.reserve(size());
        frame_.contacts.reserve(size());
        if (!ground) return;
        frame_.polygon.outer.corners.reserve(ground->corner_hull.hull.corners.capacity());
        frame_.polygon.nominal.corners.reserve(ground->centre_hull.hull.corners.capacity());
        frame_.polygon.guaranteed.corners.reserve(ground->erosion.result.corners.capacity());
    }

    // Set the force up to which each taxel is valid [N]; negative if it is masked or dead.
    void limit() {
        limits_ = most_;
        for (std::size_t i = 0; i < size(); ++i)
            if (!is_valid(i)) limits_[i] = -1.0;
    }

    bool is_valid(std::size_t i) const noexcept { return alive_[i] && !(noise_ && noise_->dead[i]); }

    // Compute the frame of the readings of the taxels.
    const Frame& update_from_taxels(double time, Flags flags) noexcept {
        const std::size_t n = size();
        const bool has_creep = creep_ && noise_;
        std::size_t known_count = 0;
        for (std::size_t i = 0; i < n; ++i) {
            const double sign = responses.sign[i];
            double reading = has_creep ? raw_[i] - creep_->part[i] * sign : raw_[i];
            if (noise_) reading -= drift_.offset[i];
            shifted_[i] = reading + baseline_[i];
            signed_[i] = reading * sign;
        }
        responses.forces_of(shifted_, forces_);
        for (std::size_t i = 0; i < n; ++i) {
            const double force = forces_[i];
            const bool is_known = force <= limits_[i];
            frame_.forces[i] = is_known ? force : 0.0;
            frame_.known[i] = is_known;
            frame_.saturated[i] = is_known && responses.saturated(i, shifted_[i]);
            known_count += is_known;
            if (frame_.saturated[i]) flags |= flag::saturated;
            if (!is_known && is_valid(i)) flags |= std::isfinite(raw_[i]) ? flag::too_large : flag::not_finite;
        }
        if (known_count == 0) return unknown(time, flags | flag::blind);
        const bool is_complete = known_count == n;
        if (!clock_.has_past(time)) {
            toucher_.forget();
            finder_.forget();
            lost_.forget();
            if (noise_) drift_.drop_block();
            if (first_) first_->clear();
        }
        faults_.compare(raw_);
        toucher_.decide(signed_, frame_.forces, frame_.known, is_complete, faults_.is_new, frame_.sets);
        flags |= faults_.find(raw_, shifted_, signed_, frame_.known, frame_.sets.active, time, clock_.period(),
                              frame_.stuck);
        if (noise_) flags |= drift_.faults(frame_.sets, frame_.stuck);
        if (flags & flag::stuck) frame_.sets.leave_out(frame_.stuck);
        if (!noise_ && !is_stated_) flags |= flag::noise_unknown;
        if (assumed_.is_assumed) {
            assumed_.add(frame_.sets.stands.value_or(false), (flags & not_that_rest) == 0, time);
            if (assumed_.is_assumed) flags |= flag::rest_assumed;
        }
        double total = 0;
        for (double push : frame_.sets.pushes) total += push;
        if (total > geometry.calibration.max_load) flags |= flag::overload;
        frame_.time = time, frame_.flags = flags, frame_.is_known = true;
        const Terms& terms = ground && ground->is_full(frame_.sets.active) ? ground->full_contact : *terms_;
        finder_.find(frame_.sets.active, frame_.forces, terms.link, frame_.rows, frame_.contacts);
        frame_.is_lost = false;
        if (is_complete) {
            lost_.clear();
        } else if (lost_.look(frame_.sets.pushes, frame_.known, [this](std::size_t i) { return is_valid(i); })) {
            frame_.is_lost = true, frame_.flags |= flag::lost;
        }
        lost_.accept(frame_.sets.pushes, frame_.known);
        std::copy(lost_.bounds.begin(), lost_.bounds.end(), frame_.lost.begin());
        add_up(terms);
        if (noise_) deviate(terms, is_complete);
        if (ground) support();
        clock_.accept(time, true);
        faults_.accept(raw_, time);
        if (noise_ && (has_creep || drift_.is_due(time))) follow(is_complete, time);
        if (first_ && is_complete) learn_at_start(time);
        return frame_;
    }

    // Compute wrench, load, CoP and ZMP.
    void add_up(const Terms& terms) noexcept {
        sums_ = {};
        for (std::size_t i = 0; i < size(); ++i) {
            const double push = frame_.sets.pushes[i];
            for (std::size_t k = 0; k < sums_.size(); ++k) sums_[k] += push * terms.rows[i][k];
        }
        if (frame_.is_lost) sums_.fill(not_a_number);
        std::copy(sums_.begin(), sums_.begin() + 6, frame_.wrench.begin());
        frame_.load = sums_[6];
        frame_.cop = frame_.zmp = frame_.cop_sigma = frame_.zmp_sigma = std::nullopt;
        const std::optional<bool>& stands = frame_.sets.stands;
        if (frame_.is_lost)
            frame_.reason = Reason::lost;
        else if (!ground)
            frame_.reason = Reason::no_ground;
        else if (stands)
            frame_.reason = *stands && sums_[6] > 0 ? Reason::none : Reason::no_load;
        else
            frame_.reason = sums_[6] >= min_load ? Reason::none : Reason::low_load;
        if (frame_.reason != Reason::none) return;
        frame_.cop = Vec2{sums_[7] / sums_[6], sums_[8] / sums_[6]};
        if (sums_[9] > 0) frame_.zmp = Vec2{sums_[11] / -sums_[9], sums_[10] / sums_[9]};
    }

    // Compute the standard deviations of forces, wrench, load, CoP and ZMP by noise and by the place in the cells.
    void deviate(const Terms& terms, bool is_complete) noexcept {
        const Numbers& pushes = frame_.sets.pushes;
        double placed = 0;
        frame_.force_sigmas.resize(size());
        for (std::size_t i = 0; i < size(); ++i) sides_[i] = shifted_[i] - noise_->sigma[i];
        responses.forces_of(sides_, low_);
        for (std::size_t i = 0; i < size(); ++i) sides_[i] = shifted_[i] + noise_->sigma[i];
        responses.forces_of(sides_, high_);
        for (std::size_t i = 0; i < size(); ++i) {
            const double low = low_[i], high = high_[i];
            const double sigma = std::abs(high - low) / (1.0 + (low > 0 && high > 0));
            frame_.force_sigmas[i] = frame_.known[i] ? sigma : infinity;
            const double weighted = frame_.sets.weights[i] * sigma;
            const double left_out = (1 - frame_.sets.weights[i]) * frame_.forces[i];
            variances_[i] = (frame_.known[i] ? weighted * weighted : 0.0) + left_out * left_out;
            variances_[i] += frame_.lost[i] * frame_.lost[i];
            if (pushes[i] > 0) {
                const double uneven = std::max(pushes[i] - geometry.mean_around(pushes, i), 0.0);
                placed += uneven * uneven * geometry.calibration.areas[i];
            }
        }
        placed /= 12; // a square has a second moment of 1/12 per area

        Vec6 squares{};
        std::array<double, 8> gradient{}; // moments in the cells that the sums leave out
        Terms::Products c{};              // covariances of the sums
        Vec6 lost{};                      // wrench of all that is lost
        Terms::Sums lost_sums{};
        const bool has_gradient = ground && !terms.has_moments;
        for (std::size_t i = 0; i < size(); ++i) {
            const double v = variances_[i], bound = frame_.lost[i];
            for (std::size_t k = 0; k < 6 && !is_complete; ++k) lost[k] += geometry.terms[i][5 + k] * bound;
            for (std::size_t k = 6; k < 12 && ground && !is_complete; ++k) lost_sums[k] += terms.rows[i][k] * bound;
            for (std::size_t k = 0; k < 6; ++k) squares[k] += squares_[i][k] * v;
            if (!ground) continue;
            for (std::size_t k = 0; k < c.size(); ++k) c[k] += terms.products[i][k] * v;
            if (!has_gradient) continue;
            for (std::size_t k = 0; k < gradient.size(); ++k) gradient[k] += ground->gradient[i][k] * pushes[i];
        }
        const double factor = noise_->common * noise_->common;
        const double hidden = frame_.sets.stands.value_or(true)
                                  ? 0.0
                                  : std::hypot(std::max(frame_.sets.excess, 0.0), noise_->load_limit / 7);
        for (std::size_t k = 0; k < 6; ++k) {
            const double by_load = hidden * geometry.mean_wrench[k];
            squares[k] = std::sqrt(squares[k] * factor + (k < 3 ? 0.0 : placed) + lost[k] * lost[k] +
                                   by_load * by_load + gradient[2 + k] * gradient[2 + k]);
        }
        frame_.wrench_sigma = squares;
        if (!ground) return;
        const Terms::Products of_lost = Terms::products_of(lost_sums);
        for (std::size_t k = 0; k < c.size(); ++k) c[k] = c[k] * factor + of_lost[k];
        frame_.load_sigma = std::hypot(std::sqrt(c[0]), hidden);
        const auto deviation = [&](double x, double load, double of_load, double of_moment, double mixed, double g) {
            const double noise = std::max(of_moment - 2 * x * mixed + x * x * of_load, 0.0);
            return std::sqrt(noise + placed + g * g) / load;
        };
        if (const auto& p = frame_.cop)
            frame_.cop_sigma = Vec2{deviation((*p)[0], sums_[6], c[0], c[1], c[3], gradient[0]),
                                    deviation((*p)[1], sums_[6], c[0], c[2], c[4], gradient[1])};
        if (const auto& p = frame_.zmp)
            frame_.zmp_sigma = Vec2{deviation((*p)[0], sums_[9], c[5], c[7], -c[9], gradient[0]),
                                    deviation((*p)[1], sums_[9], c[5], c[6], c[8], gradient[1])};
    }

    // Compute the supporting polygons.
    void support() noexcept {
        const Touched& sets = frame_.sets;
        for (std::size_t i = 0; i < size(); ++i) {
            const bool can_stand = ground->can_stand[i];
            const bool may_press = sets.possible[i] || (frame_.is_lost && !frame_.known[i]); // all that is lost
            standing_.possible[i] = can_stand && may_press;
            standing_.sure[i] = can_stand && sets.sure[i] && !frame_.has(flag::not_guaranteed);
            standing_.active[i] = can_stand && (sets.active[i] || standing_.sure[i]);
        }
        SupportingPolygon& polygon = frame_.polygon;
        if (ground->corner_hull.choose(standing_.possible)) polygon.outer = ground->corner_hull.hull;
        if (ground->centre_hull.choose(standing_.active)) polygon.nominal = ground->centre_hull.hull;
        if (ground->sure_hull.choose(standing_.sure)) {
            ground->erosion.erode(ground->sure_hull.hull);
            polygon.guaranteed = ground->erosion.result;
        }
        const bool is_probable = sets.has_sure && sets.stands && !frame_.has(flag::not_guaranteed);
        polygon.outer_probability = is_probable ? std::optional<double>(outer_probability) : std::nullopt;
        polygon.guaranteed_probability = is_probable ? std::optional<double>(guaranteed_probability) : std::nullopt;
    }

    // Follow the creep of the taxels, and the drift of the free ones.
    void follow(bool is_complete, double time) noexcept {
        for (std::size_t i = 0; i < size(); ++i) {
            const double x = raw_[i] * responses.sign[i] - (creep_ ? creep_->part[i] : 0.0);
            const bool is_used = is_complete || (std::abs(x) < max_reading && is_valid(i));
            signed_[i] = (is_used ? x : not_a_number) - noise_->free[i];
        }
        if (creep_) creep_->add(signed_, time);
        drift_.add(signed_, time);
    }

    // Return the frame of a reading that cannot be used; only the clock changes.
    const Frame& unknown(double time, Flags flags) noexcept {
        clock_.accept(time, false);
        std::fill(frame_.forces.begin(), frame_.forces.end(), 0.0);
        for (auto* list : {&frame_.known, &frame_.saturated, &frame_.stuck, &frame_.sets.active, &frame_.sets.sure,
                           &frame_.sets.possible})
            std::fill(list->begin(), list->end(), 0);
        for (auto* list : {&frame_.sets.weights, &frame_.sets.pushes}) std::fill(list->begin(), list->end(), 0.0);
        if (noise_) frame_.force_sigmas.assign(size(), infinity);
        frame_.time = time, frame_.flags = flags, frame_.is_known = frame_.is_lost = false;
        frame_.load = not_a_number;
        std::fill(frame_.lost.begin(), frame_.lost.end(), 0.0);
        frame_.sets.has_sure = false, frame_.sets.stands = std::nullopt;
        frame_.rows.clear(), frame_.contacts.clear();
        frame_.wrench.fill(not_a_number);
        frame_.reason = Reason::not_known;
        frame_.cop = frame_.zmp = frame_.cop_sigma = frame_.zmp_sigma = std::nullopt;
        frame_.wrench_sigma = std::nullopt, frame_.load_sigma = std::nullopt;
        if (ground) support(); // of no taxels: empty polygons, which the hulls remember
        return frame_;
    }

    bool is_ready_ = false, is_stated_ = false, follows_drift_ = true;
    double switch_on_ = 0.2; // [N]
    Kind kind_;              // of the last readings
    std::optional<rest::First> first_;
    rest::Assumed assumed_;
    std::size_t length_ = 0;
    std::optional<Noise> noise_;
    std::optional<Creep> creep_;
    Toucher toucher_;
    ContactFinder finder_;
    Lost lost_;
    Faults faults_;
    Drift drift_; // only with noise
    Clock clock_;
    Terms no_ground_;
    std::vector<Vec6> squares_;    // (n,) of the wrenches of 1 N
    const Terms* terms_ = nullptr; // of the sums at partial contact
    Numbers baseline_, most_, limits_, raw_, shifted_, signed_, variances_;
    Numbers forces_, sides_, low_, high_; // forces of the readings, and of those a standard deviation below and above
    Booleans alive_;
    Touched standing_; // the sets, without the taxels that cannot stand
    Terms::Sums sums_{};
    Frame frame_;
};

} // namespace skin_calib
