# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser, with a node that needs no ROS."""

import dataclasses
import re
import threading
from pathlib import Path

import numpy as np
import pytest
from browser import Visitor
from examples import cloud, surface
from panel.fake import descriptors

from socialcircle_ros import CircleSettings, remove_outliers
from socialcircle_ros.messages.header import Header
from socialcircle_ros.messages.point_cloud import encode_point_cloud
from socialcircle_ros.panel.link import Descriptor, ParameterKind, Presence
from socialcircle_ros.panel.recorded import RecordedClouds
from socialcircle_ros.panel.result_tab import ResultTab
from socialcircle_ros.panel.view import SIDE
from socialcircle_ros.panel.widgets import widget_of

BAGS = Path(__file__).resolve().parents[2] / 'bags'
SCALE = 'circle.radius_scale'


def look_from_above(tuning):
    """Turn the view, and wait until the browser says that it looks from above."""
    arrived = threading.Event()
    for client in tuning.server.get_clients().values():
        client.camera.on_update(lambda camera: camera.position[2] > 2.6 * SIDE and arrived.set())
    tuning.visitor.press('from above')
    assert arrived.wait(60)


def on_screen(tuning, row, column, *, at_its_height=True):
    """Where a point of the cloud is on the screen, seen from above; or that of the middle height at its place."""
    scene = tuning.page._node._result_tab._scene
    view = scene._view
    height = float(view.drawing.heights[row, column]) if at_its_height else view.centre[2]
    x, y, z = view.position(row, column, height, scene._stretch)
    box = tuning.visitor.page.locator('canvas').first.bounding_box()
    scale = box['height'] / 2 / np.tan(0.75 / 2) / (2.7 * SIDE - np.clip(z, -SIDE, SIDE))
    return box['x'] + box['width'] / 2 + x * scale, box['y'] + box['height'] / 2 - y * scale


def test_the_last_cloud_is_shown_with_counts_pictures_and_times(tuning):
    tuning.link.publish(cloud())
    assert tuning.visitor.sees('Showing all 5,568 kept points and all 26 outliers.')
    assert tuning.visitor.sees('expansion')
    row, column = remove_outliers(surface(), CircleSettings(mode='paper')).seed
    assert tuning.visitor.sees(f'{row}, {column}')
    assert tuning.visitor.sees('0.46 %')
    assert tuning.visitor.page.locator('.sc-chart:visible').count() == 3  # map, profile and histogram


def test_a_measurement_that_cannot_be_read_does_not_end_the_page(tuning):
    tuning.link.publish(cloud())
    assert tuning.visitor.sees('0.46 %')
    shown = tuning.link.snapshot.shown_cloud
    strange = dataclasses.replace(shown.measurement, values={**shown.measurement.values, 'kept': 'most'})
    tuning.link.update(shown_cloud=dataclasses.replace(shown, number=2, measurement=strange))
    assert tuning.visitor.sees('The measurement cannot be read.')
    assert tuning.visitor.no_longer_sees('0.46 %')
    tuning.link.publish(cloud())
    assert tuning.visitor.sees('0.46 %')


FORGED = {
    'more digits than Python converts': {'measured': '9' * 5000},
    'as many digits as Python converts': {'measured': '9' * 4000},
    'a share that is no float': {'measured': '1', 'outliers': '9' * 400},
    'infinite': {'radius': 'inf', 'time_vote_ms': '1e999', 'time_total_ms': 'nan'},
    'negative': {'measured': '-5', 'points': '-1', 'time_vote_ms': '-1'},
    'bytes that are no text': {'stamp': '\udcff\udc80', 'time_\udcff_ms': '1'},
    'long': {'stamp': '9' * 1_000_000} | {f'time_{number}_ms': '1' for number in range(100_000)},
}


def test_no_forged_measurement_ends_the_page(tuning):
    for number, (kind, values) in enumerate(FORGED.items(), 1):
        tuning.link.publish(cloud(stamp=number))
        assert tuning.visitor.sees(f'0.00000000{number}')
        shown = tuning.link.snapshot.shown_cloud
        forged = dataclasses.replace(
            shown.measurement, level=2, message=f'{kind} \udcff', hardware_id='\udcff' * 5000,
            values={**shown.measurement.values, **values},
        )  # fmt: skip
        tuning.link.update(shown_cloud=dataclasses.replace(shown, measurement=forged), sentence=f'Sent: {kind}.')
        assert tuning.visitor.sees(f'Sent: {kind}.')
        assert tuning.visitor.sees(re.compile(rf'{kind} \\udcff|cannot be read'))
    tuning.link.publish(cloud(stamp=9))
    later = Visitor(tuning.visitor.page.context.browser, tuning.address)
    for visitor in (tuning.visitor, later):
        assert visitor.sees('0.46 %')
        assert visitor.sees('0.000000009')
    later.leave()


def test_what_an_update_raises_is_shown_once_and_the_page_goes_on(tuning, monkeypatch, logged):
    def broken(*_):
        raise ZeroDivisionError('nobody expected this')

    monkeypatch.setattr(ResultTab, 'show', broken)
    for number in range(3):
        tuning.link.publish(cloud(stamp=number + 1))
        tuning.link.update(sentence=f'Update {number}.')
        assert tuning.visitor.sees(f'Update {number}.')
    tuning.visitor.open_tab('Log')
    failure = 'Showing the cloud failed: ZeroDivisionError: nobody expected this.'
    assert tuning.visitor.sees(failure)
    assert tuning.visitor.page.locator('.sc-log').get_by_text(failure).count() == 1
    assert [record.getMessage() for record in logged()] == [failure]
    monkeypatch.undo()
    tuning.link.publish(cloud())
    tuning.visitor.open_tab('Result')
    assert tuning.visitor.sees('all 26 outliers')


def test_a_link_that_fails_does_not_end_the_page(tuning, monkeypatch):
    def broken(*_):
        raise RuntimeError('the graph is gone')

    with monkeypatch.context() as patch:
        patch.setattr(tuning.link, 'wait', broken)
        tuning.visitor.open_tab('Log')
        assert tuning.visitor.sees('Updating the page failed: RuntimeError: the graph is gone.')
    tuning.link.update(sentence='It is back.')
    assert tuning.visitor.sees('It is back.')


def test_a_click_that_fails_says_why(tuning):
    tuning.visitor.open_tab('Recording')
    tuning.visitor.field('path').fill('~nobody-of-this-name/night.mcap')
    tuning.visitor.press('Open')
    tuning.visitor.open_tab('Log')
    assert tuning.visitor.sees('Opening the recording failed: RuntimeError: Could not determine home directory.')


def test_a_parameter_that_cannot_be_shown_does_not_hide_the_others(tuning, monkeypatch):
    def breaking(gui, row, *rest):
        if row.name == 'first.broken':
            raise ValueError('no control fits')
        return widget_of(gui, row, *rest)

    monkeypatch.setattr('socialcircle_ros.panel.controls.widget_of', breaking)
    rows = [Descriptor(f'first.{name}', ParameterKind.INTEGER, '', low=1, high=9) for name in ('broken', 'odd')]
    values = {**tuning.link.snapshot.values, 'first.broken': 5, 'first.odd': 5}
    tuning.link.update(descriptors=(*rows, *descriptors()), values=values)
    visitor = tuning.visitor
    visitor.open_tab('Log')
    assert visitor.sees('Making the control of first.broken failed: ValueError: no control fits.')
    visitor.page.get_by_text('circle', exact=True).locator('visible=true').first.click()
    tuning.link.update(values={**values, 'first.odd': 'no number', SCALE: 3.5})
    assert visitor.wait_until('radius scale', '3.5')
    assert visitor.sees('Showing first.odd failed: ValueError')


def test_a_value_that_cannot_be_sent_is_refused_and_the_next_one_is_sent(tuning, monkeypatch):
    def broken(_):
        raise OverflowError('too large for ROS')

    with monkeypatch.context() as patch:
        patch.setattr(tuning.link, 'change', broken)
        tuning.visitor.field('radius scale').fill('3')
        assert tuning.visitor.sees('The change cannot be sent: OverflowError: too large for ROS.')
    tuning.visitor.field('radius scale').fill('4')
    tuning.link.wait_for(lambda values: values[SCALE] == 4.0)


def test_controls_follow_the_node_s_descriptions_of_its_parameters(tuning):
    described = [dataclasses.replace(row, choices=('paper', 'bold')) if row.name == 'circle.mode' else row
            for row in descriptors()]  # fmt: skip
    flank = Descriptor('circle.flank', ParameterKind.REAL, 'How steep.', '', '0 to 1', (), 0.0, 1.0)
    tuning.link.update(descriptors=(*described[:5], flank, *described[5:]),
                       values={**tuning.link.snapshot.values, 'circle.flank': 0.25})  # fmt: skip
    visitor = tuning.visitor
    assert visitor.wait_until('flank', '0.25')
    assert visitor.slider('flank').get_attribute('aria-valuemax') == '1'
    assert visitor.sees('vote region [points]')
    visitor.choose('mode', 'bold')
    assert visitor.sees("circle.mode cannot be 'bold'")  # the settings of the fake node have no such mode
    visitor.row('flank').hover()
    assert visitor.sees('How steep (0 to 1).')


def test_moving_a_slider_changes_the_result(tuning):
    visitor = tuning.visitor
    tuning.link.publish(cloud())
    assert visitor.sees('all 26 outliers')
    visitor.slider('radius scale').press('End')
    assert visitor.sees('and no outliers')
    assert visitor.wait_until('radius scale', '100.0')
    assert tuning.link.snapshot.values[SCALE] == 100.0


def test_a_refusal_is_shown_with_its_reason_until_the_next_valid_value(tuning):
    visitor = tuning.visitor
    visitor.field('vote region [points]').fill('0, 0, 5, 0')
    assert visitor.sees('circle.vote_region [0, 0, 5, 0] is empty; give a height')
    assert visitor.wait_until('vote region [points]', 'automatic')
    visitor.field('vote region [points]').fill('0, 0, 60, 60')
    visitor.page.locator('.sc [role=alert]:visible').wait_for(state='hidden')
    assert tuning.link.snapshot.values['circle.vote_region'] == [0, 0, 60, 60]


def test_a_text_that_is_no_number_is_refused_without_asking_the_node(tuning):
    tuning.visitor.field('radius [unit of the cloud]').fill('wide')
    assert tuning.visitor.sees("circle.radius must be a number, not 'wide'.")
    assert tuning.link.asked == []


def test_tiny_lengths_can_be_typed_key_by_key(tuning):
    field = tuning.visitor.field('radius [unit of the cloud]')
    field.clear()
    field.press_sequentially('1.25e-6', delay=100)
    tuning.link.wait_for(lambda values: values['circle.radius'] == 1.25e-6)
    assert [asked['circle.radius'] for asked in tuning.link.asked] == [1.25e-6]
    tuning.visitor.open_tab('Log')
    assert tuning.visitor.sees('circle.radius: 0.0 → 1.25e-06')


def test_changes_made_elsewhere_are_shown(tuning):
    tuning.link.update(values={**tuning.link.snapshot.values, SCALE: 2.5, 'circle.window': 7})
    assert tuning.visitor.wait_until('radius scale', '2.5')
    assert tuning.visitor.wait_until('window [points]', '7')


def test_the_page_says_what_it_waits_for_and_continues(tuning):
    visitor, link = tuning.visitor, tuning.link
    link.update(presence=Presence.ABSENT, sentence='Waiting for /cell1/social_circle; start it with: x.')
    assert visitor.sees('Waiting for /cell1/social_circle; start it with: x.')
    assert visitor.sees('not found')
    visitor.page.wait_for_function('input => input.disabled', arg=visitor.field('radius scale').element_handle())
    link.update(presence=Presence.ACTIVE, sentence='Clouds are filtered as they come.')
    assert visitor.sees('Clouds are filtered as they come.')
    visitor.page.wait_for_function('input => !input.disabled', arg=visitor.field('radius scale').element_handle())


def test_after_a_restart_the_page_offers_the_settings_that_the_node_had(tuning):
    visitor, link = tuning.visitor, tuning.link
    defaults = dict(link.snapshot.values)
    link.update(values={**defaults, SCALE: 2.5, 'circle.window': 7})
    assert visitor.wait_until('radius scale', '2.5')
    assert visitor.page.get_by_role('button', name='Restore these settings').locator('visible=true').count() == 0
    link.update(starts=2, values=defaults)
    assert visitor.sees('The node was started again with other settings than it had.')
    assert visitor.wait_until('radius scale', '1.0')
    visitor.press('Restore these settings')
    assert visitor.wait_until('radius scale', '2.5')
    assert link.asked == [{SCALE: 2.5, 'circle.window': 7}]
    assert visitor.no_longer_sees('The node was started again with other settings than it had.')
    link.update(starts=3, values=defaults)
    visitor.press('Keep the new settings')
    assert visitor.no_longer_sees('The node was started again with other settings than it had.')
    assert link.snapshot.values == defaults
    # A lesson that is gone meanwhile does not keep the others back.
    link.update(values={**defaults, SCALE: 3.5, 'circle.lesson': '/gone/part.teach'})
    assert visitor.wait_until('radius scale', '3.5')
    link.update(starts=4, values=defaults)
    visitor.press('Restore these settings')
    assert visitor.wait_until('radius scale', '3.5')
    assert visitor.sees('circle.lesson: /gone/part.teach cannot be used')


def test_presets_are_saved_and_loaded_and_a_load_is_undone(tuning):
    visitor, link = tuning.visitor, tuning.link
    visitor.field('radius scale').fill('3')
    visitor.open_tab('Presets')
    visitor.field('name').fill('wide')
    link.wait_for(lambda values: values[SCALE] == 3.0)
    visitor.press('Save current settings')
    assert visitor.sees('wide.yaml.')
    saved = tuning.presets.load('wide')
    assert saved[SCALE] == 3.0
    assert 'autostart' not in saved  # it is read-only
    assert link.change({SCALE: 0.5}) == ''
    visitor.press('Load preset into the node')
    assert visitor.sees('Loaded the preset wide.')
    assert link.snapshot.values[SCALE] == 3.0
    visitor.open_tab('Tune')
    visitor.press('Undo')
    assert visitor.wait_until('radius scale', '0.5')


def test_the_reason_is_shown_when_the_node_refuses_a_preset(tuning):
    bad = tuning.presets.save('bad', {'circle.vote_region': [0, 0, 1, 0]})
    tuning.page._node._preset_tab.refresh()
    tuning.visitor.open_tab('Presets')
    tuning.visitor.press('Load preset into the node')
    assert tuning.visitor.sees('The node refused the preset bad: circle.vote_region [0, 0, 1, 0] is empty')
    tuning.presets.save('bad', {'circle.window': 4})
    tuning.visitor.press('Load preset into the node')
    assert tuning.visitor.sees(f'{bad}: circle.window must be odd')


def test_two_settings_are_compared_side_by_side_on_the_same_cloud(tuning):
    visitor = tuning.visitor
    tuning.presets.save('gentle', {SCALE: 100.0})
    tuning.page._node._preset_tab.refresh()
    tuning.link.publish(cloud())
    assert visitor.sees('all 26 outliers')
    visitor.open_tab('Presets')
    visitor.choose('B', 'gentle')
    visitor.press('Compare on this cloud')
    assert visitor.sees('only A 26')
    assert visitor.sees('A: current settings')
    assert visitor.sees('B: gentle')
    assert tuning.link.asked == []
    tuning.link.publish(cloud(seed=3, stamp=2))  # the comparison is made again on the next cloud
    assert visitor.sees('The cloud with the stamp 0.000000002 s: A current settings, B gentle')
    assert visitor.sees('only B 0')
    visitor.press('Close the comparison')
    assert visitor.no_longer_sees('B: gentle')
    assert visitor.sees('The cloud with the stamp 0.000000002 s')


def test_a_recording_is_stepped_cloud_by_cloud(tuning):
    visitor, link = tuning.visitor, tuning.link
    with RecordedClouds(BAGS / 'parts.mcap') as clouds:
        recorded = [clouds.message(number).data for number in range(3)]
    visitor.open_tab('Recording')
    visitor.field('path').fill(str(BAGS / 'parts.mcap'))
    visitor.press('Open')
    assert visitor.sees('Cloud 1 of 8')
    visitor.press('next ▶')
    assert visitor.sees('Cloud 2 of 8')
    visitor.press('next ▶')
    assert visitor.sees('Cloud 3 of 8 of parts.mcap, recorded')
    visitor.press('◀ previous')
    assert visitor.sees('Cloud 2 of 8')
    with link.changed:  # the page says where it is before the node has the cloud
        link.changed.wait_for(lambda: len(link.published) == 4, 60)
    assert link.published == [recorded[0], recorded[1], recorded[2], recorded[1]]
    visitor.field('path').fill('/nowhere.mcap')
    visitor.press('Open')
    assert visitor.sees('/nowhere.mcap does not exist')
    assert visitor.sees('Cloud 2 of 8 of parts.mcap, recorded')  # it stays open
    visitor.page.reload()
    assert visitor.sees('Cloud 2 of 8 of parts.mcap')


def test_a_recording_of_frames_is_opened_with_the_parameters_beside_it(tuning, monkeypatch):
    visitor, link = tuning.visitor, tuning.link
    visitor.open_tab('Recording')
    visitor.field('path').fill(str(BAGS / 'stack.mcap'))
    visitor.press('Open')
    assert visitor.sees('stack.pitch_x is not set')
    before = link.snapshot
    with monkeypatch.context() as patch:
        # The page follows the node some time after the change: opening must not wait for that, nor miss it.
        patch.setattr(link, 'wait', lambda revision, timeout_s: before)
        visitor.press('Load stack.yaml into the node, and open')
        assert visitor.sees('Stack 1 of 1 of stack.mcap')
    assert visitor.sees('pixels: saturated')
    assert visitor.sees('of measured')
    assert visitor.no_longer_sees('stack.pitch_x is not set')
    assert link.snapshot.values['stack.frames'] == 32
    look_from_above(tuning)
    visitor.page.mouse.click(*on_screen(tuning, 30, 40))
    visitor.press('Focus curve of this point')
    assert visitor.sees(re.compile('focus curve: peak at .* µm, quality 0'))


def test_a_cloud_of_a_recording_is_sent_when_the_node_becomes_active(tuning):
    visitor, link = tuning.visitor, tuning.link
    link.update(presence=Presence.ABSENT, sentence='Waiting for it.')
    assert visitor.sees('Waiting for it.')
    visitor.open_tab('Recording')
    visitor.field('path').fill(str(BAGS / 'parts.mcap'))
    visitor.press('Open')
    assert visitor.sees('It will be sent when the node is active.')
    visitor.press('next ▶')
    assert visitor.sees('Cloud 2 of 8')
    assert link.published == []
    link.update(presence=Presence.ACTIVE, sentence='Here it is.')
    assert visitor.no_longer_sees('It will be sent when the node is active.')
    with link.changed:  # the page says what it does before it is done
        assert link.changed.wait_for(lambda: link.published, 60)
    with RecordedClouds(BAGS / 'parts.mcap') as clouds:
        assert link.published == [clouds.message(1).data]


def test_a_click_on_an_outlier_says_why_it_was_removed(tuning):
    visitor, mouse = tuning.visitor, tuning.visitor.page.mouse
    tuning.link.publish(cloud())
    assert visitor.sees('Click a point in the scene to see why it was removed or kept.')
    look_from_above(tuning)
    outliers = tuning.page._node._result_tab._view.drawing.outliers
    row, column = np.argwhere(outliers)[len(np.argwhere(outliers)) // 2].tolist()
    place = on_screen(tuning, row, column)
    mouse.click(*place)
    assert visitor.sees(f'Outlier: row {row}, column {column}')


def test_a_region_that_is_drawn_is_measured_on_every_cloud_of_one_size(tuning):
    visitor, mouse = tuning.visitor, tuning.visitor.page.mouse
    tuning.link.publish(cloud())
    visitor.press('Look at a region')
    assert visitor.sees('Drag a rectangle over the cloud.')
    mouse.move(*on_screen(tuning, 20, 20, at_its_height=False))
    mouse.down()
    mouse.move(*on_screen(tuning, 40, 50, at_its_height=False), steps=5)
    mouse.up()
    assert visitor.sees(re.compile('Region: rows (19|20|21) to (39|40|41), columns (19|20|21) to (49|50|51)'))
    tuning.link.publish(cloud(seed=3, stamp=2))
    assert visitor.sees('The cloud with the stamp 0.000000002 s')
    visitor.press('Close the region')
    assert visitor.no_longer_sees('Region: rows')


def test_a_million_points_are_thinned_and_all_outliers_are_drawn(tuning):
    y, x = np.mgrid[:960, :1280].astype(np.float32)
    z = np.random.default_rng(0).random(x.shape, np.float32)
    z[::37, ::41] = 50
    tuning.link.publish(encode_point_cloud(Header.at(1, 'microscope'), np.dstack([x, y, z])))
    assert tuning.visitor.sees(f'all {z[::37, ::41].size:,} outliers')
    assert tuning.visitor.sees('kept points (1 of 9)')


def test_clouds_that_come_too_fast_are_skipped_and_the_newest_is_drawn(tuning, monkeypatch):
    drawn = []
    draw = ResultTab._draw

    def counted(tab, shown, state):
        drawn.append(shown.number)
        draw(tab, shown, state)

    monkeypatch.setattr(ResultTab, '_draw', counted)
    for number in range(60):
        tuning.link.publish(cloud(stamp=number + 1))
    assert tuning.visitor.sees('0.000000060')
    assert drawn == sorted(set(drawn))
    assert drawn[-1] == 60
    assert len(drawn) < 60


@pytest.mark.parametrize('text', ['<img src=x onerror="window.broken=1">', '<script>window.broken=1</script>'])
def test_text_from_outside_is_not_read_as_markup(tuning, text):
    tuning.link.update(presence=Presence.ACTIVE, level=2, sentence=text)
    assert tuning.visitor.sees(text)
    assert tuning.visitor.page.evaluate('window.broken') is None


@pytest.mark.parametrize(('width', 'height'), [(1280, 800), (1920, 1080)])
def test_nothing_is_cut_off_on_usual_screens(tuning, width, height):
    visitor = tuning.visitor
    visitor.page.set_viewport_size({'width': width, 'height': height})
    tuning.link.publish(cloud())
    for text in (
        '/cell1/social_circle',
        'radius scale',
        'of measured',
        'height of kept points',
        'map: ',
    ):
        visitor.sees(text)
        box = visitor.page.get_by_text(text).locator('visible=true').first.bounding_box()
        assert box['x'] >= 0
        assert box['x'] + box['width'] <= width
        assert box['y'] + box['height'] <= height
